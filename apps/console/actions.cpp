#include "actions.hpp"

#include "hold_button.hpp"
#include "theme.hpp"
#include "units.hpp"

#include <components/gui_client/leg_check.hpp>
#include <components/gui_client/words.hpp>

#include <QApplication>
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
    auto* go = new hold_button(tr("Hold to send"), &box);
    go->setProperty("role", "danger");
    box.addButton(go, QMessageBox::AcceptRole);
    auto* stay = box.addButton(tr("Cancel"), QMessageBox::RejectRole);
    box.setDefaultButton(stay); // Enter does no harm
    box.setEscapeButton(stay);
    box.exec();
    return box.clickedButton() == go;
}

template <class What>
std::string operator_actions::trouble_of(const What& what) const {
    if (!seen_ || !seen_->sea) return {};
    return leg_trouble(leg_context{*seen_->sea, seen_->boat, seen_->mission}, what);
}

bool operator_actions::overridden(const QString& what, const std::string& trouble) {
    return confirmed(tr("Land or fence in the way: %1").arg(what),
                     text(trouble) + "\n\n" +
                         tr("The boat itself turns back at its fence and before the coast, as long as its parameter "
                            "“fence” is 1."));
}

std::optional<taking> operator_actions::authority_for(const QString& what) {
    if (!seen_ || !seen_->authority.known || seen_->authority.mine()) return taking::no;
    auto authority = seen_->authority; // snapshots go on while the question is open
    QMessageBox box(window_);
    box.setObjectName("authority");
    box.setWindowTitle(tr("Authority over the boat"));
    box.setIcon(QMessageBox::Question);
    const auto& holder = authority.state.holder;
    auto name = text(operator_label(holder));
    auto* stay = box.addButton(tr("Cancel"), QMessageBox::RejectRole);
    box.setEscapeButton(stay);
    QPushButton *take = nullptr, *ask = nullptr;
    if (holder.empty()) {
        box.setText(tr("Nobody has the authority over the boat. Take it and send: %1?").arg(what));
        box.setInformativeText(tr("The other operators see that you have it until you give it up."));
        take = box.addButton(tr("Take it and send"), QMessageBox::AcceptRole);
        box.setDefaultButton(take);
    } else {
        box.setText(tr("%1 has the authority over the boat. Not sent: %2").arg(name, what));
        box.setInformativeText(tr("Request the authority, or take it: then %1 cannot continue.").arg(name));
        ask = box.addButton(tr("Ask %1").arg(name), QMessageBox::ActionRole);
        take = box.addButton(tr("Take it and send"), QMessageBox::DestructiveRole);
        box.setDefaultButton(stay);
    }
    box.exec();
    if (ask && box.clickedButton() == ask) {
        change_authority change;
        change.request.action = authority_action::ask;
        act(std::move(change));
        return std::nullopt;
    }
    if (box.clickedButton() != take) return std::nullopt;
    return holder.empty() ? taking::if_free : taking::from_holder;
}

bool operator_actions::has_ended() {
    if (ended_) Q_EMIT said(tr("Not sent: the console's connection has ended; start the console again"));
    return ended_;
}

bool operator_actions::act(action what) {
    if (has_ended()) return false;
    if (to_(std::move(what))) return true;
    Q_EMIT said(tr("Not sent: the console's connection has ended or is overloaded"));
    return false;
}

QString operator_actions::validity_text(command_kind kind, std::optional<float> valid_s) const {
    auto seconds = [](double s) { return s >= 3600 ? tr("%1 h").arg(s / 3600) : tr("%1 s").arg(s); };
    if (valid_s) return tr("valid for %1").arg(seconds(static_cast<double>(*valid_s)));
    auto usual = [&](link_id link) { return seconds(static_cast<double>(default_validity(kind, link).count())); };
    if (auto link = link_of_path(via_)) return tr("valid for %1").arg(usual(*link));
    return tr("valid for %1, by Iridium %2").arg(usual(link_id::xbee), usual(link_id::iridium));
}

bool operator_actions::give(boat_command command, std::optional<float> valid_s) {
    if (has_ended()) return false;
    if (given_ == command && since_given_.elapsed() < QApplication::doubleClickInterval()) return false;
    if (!valid_s) valid_s = valid_s_;
    auto what = text(describe(command));
    auto valid = validity_text(command.kind(), valid_s);
    if (auto why = danger(command);
        !why.empty() && !confirmed(tr("Tell the boat: %1?").arg(what), text(why) + "\n" + tr("It is %1.").arg(valid)))
        return false;
    auto trouble = trouble_of(command);
    if (!trouble.empty() && !overridden(what, trouble)) return false;
    give_command one;
    one.over_limits = !trouble.empty();
    one.valid_s = valid_s;
    one.confirmed = !command.danger().empty(); // above
    if (traits_of(command.kind()).needs_authority) {
        auto take = authority_for(what);
        if (!take) return false;
        one.authority = *take;
    }
    one.command = command;
    one.via = via_;
    if (!act(std::move(one))) return false;
    given_ = std::move(command);
    since_given_.start();
    Q_EMIT said(tr("Given: %1, %2").arg(what, valid));
    return true;
}

bool operator_actions::set_mode(sailing_mode mode) { return give(commands::set_mode{mode}); }

bool operator_actions::upload(std::vector<waypoint> points, const std::vector<waypoint>& on_boat, bool held) {
    if (has_ended()) return false;
    auto many = static_cast<int>(points.size());
    auto what = many == 0
                    ? tr("Clear the boat's list of waypoints?")
                    : tr("Upload %n waypoint(s) to the boat?", nullptr, many).replace("(s)", many == 1 ? "" : "s");
    auto why =
        tr("This replaces the boat's present list of %1, which the boat keeps until the whole new one has arrived.")
            .arg(on_boat.size());
    auto trouble = trouble_of(points);
    held = held && !points.empty(); // to clear the boat's list always takes the question
    if (trouble.empty() ? !held && !confirmed(what, why) : !overridden(tr("the new list of waypoints"), trouble))
        return false;
    auto take = authority_for(tr("the new list of waypoints"));
    if (!take) return false;
    upload_mission mission;
    mission.over_limits = !trouble.empty();
    mission.points = std::move(points);
    mission.via = via_;
    mission.authority = *take;
    return act(std::move(mission));
}

bool operator_actions::sail_there(const waypoint& point) {
    if (has_ended()) return false;
    auto where = place_text(point);
    auto trouble = trouble_of(point);
    if (trouble.empty() ? !confirmed(tr("Sail to %1?").arg(where),
                                     tr("The place becomes the next waypoint; the boat then continues with its list, "
                                        "in Auto."))
                        : !overridden(tr("sail to %1").arg(where), trouble))
        return false;
    auto take = authority_for(tr("sail to %1").arg(where));
    if (!take) return false;
    sail_to there;
    there.point = point;
    there.over_limits = !trouble.empty();
    there.via = via_;
    there.authority = *take;
    if (!act(std::move(there))) return false;
    Q_EMIT said(tr("Sent: sail to %1").arg(where));
    return true;
}

} // namespace atirma::console
