#pragma once
#include "units.hpp"

#include <components/gui_client/alarm.hpp>

#include <QByteArray>
#include <QString>

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace atirma::console {

/// The settings that belong to one boat.
struct boat_memory {
    std::vector<acknowledged_alarm> acknowledged;
    bool draft_edited = false; ///< the list of waypoints was edited and not uploaded
    std::vector<waypoint> draft;
    bool operator==(const boat_memory&) const = default;
};

/// The settings of the console, and what is kept of its (first) boat. Data of the boat are not among them: they are
/// requested again.
struct console_memory : boat_memory {
    std::optional<bool> night;
    bool red = false; ///< red night colours
    units shown;
    alarm_limits limits;
    std::map<std::string, boat_memory> more_boats; ///< of a fleet, by name
    QByteArray geometry, split;                    ///< as Qt writes them
    QString tab;
    bool follow = true;
    double tail_s = 0;
    std::optional<waypoint> chart_centre;
    double metres_per_pixel = 3;
    bool operator==(const console_memory&) const = default;
};

/// The settings file (INI). Of a damaged or hand-written file, the valid values are used.
class settings_file {
public:
    /// Empty: nothing is saved.
    explicit settings_file(QString path) : path_(std::move(path)) {}
    const QString& path() const noexcept { return path_; }
    /// Returns the saved settings; sets `trouble` to the file's error, or to an empty string.
    console_memory load(QString& trouble) const;
    /// Returns why it cannot be saved, or an empty string.
    QString save(const console_memory& memory);
    /// The file in the user's configuration folder.
    static QString usual();

private:
    QString path_;
    std::optional<console_memory> saved_;
};

} // namespace atirma::console
