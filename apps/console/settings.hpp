#pragma once
#include "units.hpp"

#include <components/gui_client/alarm.hpp>

#include <QByteArray>
#include <QString>

#include <optional>
#include <vector>

namespace atirma::console {

/// What the console keeps over a start. What the boat said is not among it: that is asked for anew.
struct console_memory {
    std::optional<bool> night;
    units shown;
    alarm_limits limits;
    std::vector<acknowledged_alarm> acknowledged;
    bool draft_edited = false; ///< the list of waypoints was changed here, and not uploaded
    std::vector<waypoint> draft;
    QByteArray geometry, split; ///< as Qt writes them
    QString tab;
    bool follow = true;
    double tail_s = 0;
    std::optional<waypoint> chart_centre;
    double metres_per_pixel = 3;
    bool operator==(const console_memory&) const = default;
};

/// The file of it (INI). A file that is damaged, or written by hand, gives what is in it and makes sense.
class settings_file {
public:
    /// Empty: nothing is kept.
    explicit settings_file(QString path) : path_(std::move(path)) {}
    const QString& path() const noexcept { return path_; }
    /// What was kept; `trouble` says what was wrong with the file, else it is empty.
    console_memory load(QString& trouble) const;
    /// Empty, or why it cannot be kept.
    QString save(const console_memory& memory);
    /// The one of this user, where programs keep such things.
    static QString usual();

private:
    QString path_;
    std::optional<console_memory> saved_;
};

} // namespace atirma::console
