#pragma once
#include "actions.hpp"

#include <components/gui_client/view.hpp>

#include <QToolButton>

namespace atirma::console {

/// Who commands the boat, and what can be done about it: take, ask, hand over, give up. Hidden where no communication
/// node is there to say.
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
