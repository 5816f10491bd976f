#pragma once
#include <components/boat/boat_command.hpp>

#include <QDialog>

#include <functional>
#include <optional>
#include <utility>
#include <vector>

class QFormLayout;
class QLabel;
class QPushButton;
class QSpinBox;

namespace atirma::console {

class number_box;

/// The arguments of any telecommand: a row for each field of its struct. Values that the boat would refuse cannot be
/// accepted.
class telecommand_dialog : public QDialog {
    Q_OBJECT
public:
    /// Begins with the arguments that `preset` has.
    /// `usual`: the validity that it has unless it is changed, in words.
    explicit telecommand_dialog(const boat_command& preset, const QString& usual = {}, QWidget* parent = nullptr);
    const boat_command& command() const noexcept { return command_; }
    /// Nothing: the usual one.
    std::optional<float> valid_s() const;

private:
    // One editor for each type of argument; it writes to the argument.
    template <class T>
    void add_editor(const QString& name, T& value);
    void add_editor(const QString& name, waypoint& value);
    void add_editor(const QString& name, std::string& value);
    void check_command();

    boat_command command_;
    QFormLayout* form_;
    std::vector<std::pair<QString, number_box*>> numbers_;
    QLabel* trouble_;
    QPushButton* accept_;
    QSpinBox* valid_;
};

} // namespace atirma::console
