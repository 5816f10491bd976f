#pragma once
#include "actions.hpp"

#include <components/gui_client/view.hpp>

#include <QToolButton>

namespace atirma::console {

/// The holder of the authority over the boat, with a menu: take, request, hand over, give up. Hidden without a
/// communication node.
class command_button : public QToolButton {
    Q_OBJECT
public:
    explicit command_button(operator_actions& actions, QWidget* parent = nullptr);
    void show_snapshot(const snapshot& seen);

private:
    void fill_menu();
    void ask_for(authority_action what, const std::string& to = {}, bool confirmed = false);

    operator_actions& actions_;
    authority_view seen_;
    std::vector<std::string> others_; ///< paths of the other consoles
};

} // namespace atirma::console
