#include "actions.hpp"

#include "theme.hpp"

#include <components/gui_client/words.hpp>

#include <QMessageBox>
#include <QPushButton>

namespace atirma::console {

bool operator_actions::confirmed(const QString& what, const QString& why) {
    QMessageBox box(window_);
    box.setObjectName("confirm");
    box.setWindowTitle(tr("Are you sure?"));
    box.setIcon(QMessageBox::Warning);
    box.setText(what);
    box.setInformativeText(why);
    auto* go = box.addButton(tr("Send it"), QMessageBox::AcceptRole);
    auto* stay = box.addButton(tr("Cancel"), QMessageBox::RejectRole);
    box.setDefaultButton(stay); // Enter does no harm
    box.setEscapeButton(stay);
    box.exec();
    return box.clickedButton() == go;
}

bool operator_actions::act(action what) {
    if (to_(std::move(what))) return true;
    Q_EMIT said(tr("Nothing was given: the console's connection has ended or is overloaded"));
    return false;
}

bool operator_actions::give(boat_command command) {
    auto what = text(describe(command));
    if (auto why = danger(command); !why.empty() && !confirmed(tr("Tell the boat: %1?").arg(what), text(why)))
        return false;
    give_command one;
    one.command = command;
    one.via = via_;
    if (!act(std::move(one))) return false;
    Q_EMIT said(tr("Given: %1").arg(what));
    return true;
}

bool operator_actions::set_mode(sailing_mode mode) {
    boat_command command;
    command.kind = command_kind::set_mode;
    command.mode = mode;
    return give(command);
}

bool operator_actions::simple(command_kind kind) {
    boat_command command;
    command.kind = kind;
    return give(command);
}

bool operator_actions::upload(std::vector<waypoint> points, const std::vector<waypoint>& on_boat) {
    auto many = static_cast<int>(points.size());
    auto what = many == 0
                    ? tr("Clear the boat's list of waypoints?")
                    : tr("Upload %n waypoint(s) to the boat?", nullptr, many).replace("(s)", many == 1 ? "" : "s");
    auto why =
        tr("The list of %1 that the boat has now is replaced, one telecommand after the other. "
           "Meanwhile, in Auto, it sails what has arrived.")
            .arg(on_boat.size());
    if (!confirmed(what, why)) return false;
    upload_mission mission;
    mission.points = std::move(points);
    mission.via = via_;
    return act(std::move(mission));
}

} // namespace atirma::console
