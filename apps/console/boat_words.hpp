#pragma once
#include <components/gui_client/view.hpp>

#include <QColor>
#include <QString>

// The state of a boat in few words: for the header, and for the list of boats.
namespace atirma::console {

struct state_words {
    QString words; ///< "live · GPRS", "no current data"
    QString age;   ///< "12 s"; empty where there is no position
    QColor ink, back;
};
/// How current the position is; red while the alarm for a silent boat is on.
state_words state_of(const snapshot& seen, utc_time now);
/// Of a boat whose component has ended: nothing newer comes.
state_words state_of_ended();

/// "Auto", "Heading · 12 min" with the time until it loiters (Manual alike), "–"; of a report that is stale, with its
/// age, "Auto? 12 min".
QString mode_words(const snapshot& seen, utc_time now);

} // namespace atirma::console
