#pragma once
#include <components/boat/boat_command.hpp>

#include <QDialog>

#include <functional>
#include <utility>
#include <vector>

class QFormLayout;
class QLabel;
class QPushButton;

namespace atirma::console {

class number_box;

/// The arguments of any telecommand: a row for each field of its struct. Values that the boat would refuse cannot be
/// accepted.
class telecommand_dialog : public QDialog {
    Q_OBJECT
public:
    /// Begins with the arguments that `preset` has.
    explicit telecommand_dialog(const boat_command& preset, QWidget* parent = nullptr);
    const boat_command& command() const noexcept { return command_; }

private:
    // One editor for each type of argument; it writes to the argument.
    template <class T>
    void add_editor(const QString& name, T& value);
    void add_editor(const QString& name, waypoint& value);
    void check_command();

    boat_command command_;
    QFormLayout* form_;
    std::vector<std::pair<QString, number_box*>> numbers_;
    QLabel* trouble_;
    QPushButton* accept_;
};

} // namespace atirma::console
