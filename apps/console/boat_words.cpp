#include "boat_words.hpp"

#include "theme.hpp"

#include <components/boat/parameters.hpp>
#include <components/gui_client/freshness.hpp>
#include <components/gui_client/words.hpp>

#include <QObject>

#include <algorithm>

namespace atirma::console {

state_words state_of(const snapshot& seen, utc_time now) {
    const auto& t = colours();
    const auto& boat = seen.boat;
    auto how = freshness_of(boat.position, value_kind::position, boat, now);
    state_words made{QObject::tr("no boat yet"), QString(), t.ink3, t.field};
    if (how != freshness::none) {
        auto link = text(label(boat.position->link));
        made.age = text(age_text(age_s(now, boat.position->measured_at)));
        made.words = how == freshness::fresh    ? QObject::tr("live · %1").arg(link)
                     : how == freshness::ageing ? QObject::tr("old · %1").arg(link)
                                                : QObject::tr("no current data");
        made.ink = t.of(how);
        made.back = how == freshness::fresh ? t.field : t.warn_back;
        if (boat.on_beacon()) {
            made.words = QObject::tr("BEACON");
            made.ink = t.bad, made.back = t.bad_back;
        }
    }
    bool silent = std::ranges::any_of(seen.alarms, [](const auto& a) { return a.key == "no_data" && !a.over_at; });
    if (silent) made.ink = t.bad, made.back = t.bad_back; // red is for alarms
    return made;
}

state_words state_of_ended() { return {QObject::tr("ended"), QString(), colours().bad, colours().bad_back}; }

QString mode_words(const snapshot& seen, utc_time at) {
    const auto& boat = seen.boat;
    if (!boat.sailing) return QStringLiteral("–");
    const auto& n = boat.sailing->value;
    if (boat.on_beacon()) return QObject::tr("mode not known");
    if (freshness_of(boat.sailing, value_kind::sailing, boat, at) == freshness::stale)
        return QObject::tr("%1? %2").arg(n.remote_control ? QObject::tr("Remote") : text(label(n.mode)),
                                         text(age_text(age_s(at, boat.sailing->measured_at))));
    if (n.remote_control) return QObject::tr("Remote control");
    auto words = text(label(n.mode));
    if (n.in_irons) return words + QObject::tr(" · in irons");
    if (n.at_fence) return words + QObject::tr(" · fence");
    bool ends = n.mode == sailing_mode::hold || n.mode == sailing_mode::manual;
    if (!ends || !boat.mode_since) return words;
    double limit_s = 0;
    if (const auto* info = find_parameter(parameter_id::heading_time_limit))
        limit_s = static_cast<double>(info->initial);
    for (const auto& one : seen.parameters)
        if (one.id == parameter_id::heading_time_limit && one.confirmed) limit_s = static_cast<double>(*one.confirmed);
    double left_s = std::max(0.0, limit_s - age_s(at, *boat.mode_since));
    return left_s >= 90 ? QObject::tr("%1 · %2 min").arg(words).arg(left_s / 60, 0, 'f', 0)
                        : QObject::tr("%1 · %2 s").arg(words).arg(left_s, 0, 'f', 0);
}

} // namespace atirma::console
