#include "settings.hpp"

#include "mission_draft.hpp"

#include <QDir>
#include <QFile>
#include <QFileInfo>
#include <QSettings>
#include <QStandardPaths>
#include <QUrl>

#include <algorithm>
#include <cmath>

namespace atirma::console {
namespace {

constexpr int format_version = 1;

/// Sets a number if it is within its range.
template <class Number>
void read(const QSettings& from, const QString& key, Number& into, double low, double high) {
    bool good = false;
    double value = from.value(key).toDouble(&good);
    if (good && value >= low && value <= high) into = static_cast<Number>(value);
}

template <class Enum>
void read_choice(const QSettings& from, const QString& key, Enum& into, const QStringList& names) {
    auto place = names.indexOf(from.value(key).toString());
    if (place >= 0) into = static_cast<Enum>(place);
}

const QStringList speeds{"kn", "m/s", "km/h"}, distances{"nautical", "metric"}, places{"minutes", "decimal"},
    severities{"notice", "warning", "critical"};

QString name_in(const QStringList& names, auto value) { return names[static_cast<int>(value)]; }

void read_limits(const QSettings& from, alarm_limits& limits) {
    read(from, "alarms/no_data_s", limits.no_data_s, 5, 86400);
    read(from, "alarms/link_silent_s", limits.link_silent_s, 5, 86400);
    read(from, "alarms/proxy_lost_s", limits.proxy_lost_s, 1, 3600);
    read(from, "alarms/battery_low_percent", limits.battery_low_percent, 0, 100);
    read(from, "alarms/battery_critical_percent", limits.battery_critical_percent, 0, 100);
    read(from, "alarms/off_track_m", limits.off_track_m, 5, 10000);
    read(from, "alarms/modem_hot_c", limits.modem_hot_c, 20, 100);
    read(from, "alarms/duty_percent", limits.duty_percent, 1, 100);
}

std::optional<waypoint> place_of(const QString& words) {
    auto parts = words.split(' ');
    if (parts.size() != 2) return std::nullopt;
    bool north = false, east = false;
    waypoint at{parts[0].toDouble(&north), parts[1].toDouble(&east)};
    if (!north || !east || !(std::abs(at.latitude_deg) <= 90) || !(std::abs(at.longitude_deg) <= 180))
        return std::nullopt;
    return at;
}

QString words_of(const waypoint& at) {
    return QStringLiteral("%1 %2").arg(at.latitude_deg, 0, 'f', 8).arg(at.longitude_deg, 0, 'f', 8);
}

/// `group`: empty for the first boat.
void read_boat(const QSettings& from, const QString& group, boat_memory& into) {
    for (const auto& line : from.value(group + "alarms/acknowledged").toStringList()) {
        auto how = severities.indexOf(line.section(' ', 0, 0));
        auto key = line.section(' ', 1);
        if (how < 0 || key.isEmpty() || into.acknowledged.size() >= alarm_book::max_alarms) continue;
        into.acknowledged.push_back({key.toStdString(), static_cast<severity>(how)});
    }
    into.draft_edited = from.value(group + "mission/edited").toBool();
    for (const auto& line : from.value(group + "mission/waypoints").toStringList())
        if (auto at = place_of(line); at && into.draft.size() < mission_draft::most) into.draft.push_back(*at);
}

void write_boat(QSettings& to, const QString& group, const boat_memory& memory) {
    QStringList alarms, waypoints;
    for (const auto& one : memory.acknowledged)
        alarms << name_in(severities, one.how) + " " + QString::fromStdString(one.key);
    to.setValue(group + "alarms/acknowledged", alarms);
    to.setValue(group + "mission/edited", memory.draft_edited);
    for (const auto& at : memory.draft) waypoints << words_of(at);
    to.setValue(group + "mission/waypoints", waypoints);
}

constexpr qsizetype max_boats = 100; // that are read

/// A name may have a '/'.
QString group_of(const std::string& boat) {
    return "boats/" + QString::fromLatin1(QUrl::toPercentEncoding(QString::fromStdString(boat))) + "/";
}

} // namespace

QString settings_file::usual() {
    auto folder = QStandardPaths::writableLocation(QStandardPaths::GenericConfigLocation);
    return folder.isEmpty() ? QString() : folder + "/atirma/console.ini";
}

console_memory settings_file::load(QString& trouble) const {
    console_memory made;
    if (path_.isEmpty() || !QFile::exists(path_)) return made;
    if (QFile file(path_); !file.open(QIODevice::ReadOnly)) {
        trouble = QObject::tr("cannot read the settings %1 (%2): the console starts with defaults")
                      .arg(path_, file.errorString());
        return made;
    }
    QSettings from(path_, QSettings::IniFormat);
    if (from.status() != QSettings::NoError || from.value("version").toInt() != format_version) {
        trouble = QObject::tr("%1 is not a settings file of this console: it starts with defaults").arg(path_);
        return made;
    }
    if (from.contains("look/night")) made.night = from.value("look/night").toBool();
    made.red = from.value("look/red").toBool();
    read_choice(from, "units/speed", made.shown.speed, speeds);
    read_choice(from, "units/distance", made.shown.distance, distances);
    read_choice(from, "units/place", made.shown.place, places);
    read_limits(from, made.limits);
    read_boat(from, {}, made);
    from.beginGroup("boats");
    auto boats = from.childGroups();
    from.endGroup();
    for (const auto& boat : boats.mid(0, max_boats))
        read_boat(from, "boats/" + boat + "/",
                  made.more_boats[QUrl::fromPercentEncoding(boat.toLatin1()).toStdString()]);
    made.geometry = from.value("window/geometry").toByteArray();
    made.split = from.value("window/split").toByteArray();
    made.tab = from.value("window/tab").toString();
    made.follow = from.value("chart/follow", true).toBool();
    read(from, "chart/tail_s", made.tail_s, 0, 1e7);
    made.chart_centre = place_of(from.value("chart/centre").toString());
    read(from, "chart/metres_per_pixel", made.metres_per_pixel, 0.02, 400);
    return made;
}

QString settings_file::save(const console_memory& memory) {
    if (path_.isEmpty() || saved_ == memory) return {};
    if (auto folder = QFileInfo(path_).absolutePath(); !QDir().mkpath(folder))
        return QObject::tr("cannot save the settings: there is no folder %1").arg(folder);
    QSettings to(path_, QSettings::IniFormat);
    to.setValue("version", format_version);
    if (memory.night) to.setValue("look/night", *memory.night);
    to.setValue("look/red", memory.red);
    to.setValue("units/speed", name_in(speeds, memory.shown.speed));
    to.setValue("units/distance", name_in(distances, memory.shown.distance));
    to.setValue("units/place", name_in(places, memory.shown.place));
    const auto& limits = memory.limits;
    to.setValue("alarms/no_data_s", limits.no_data_s);
    to.setValue("alarms/link_silent_s", limits.link_silent_s);
    to.setValue("alarms/proxy_lost_s", limits.proxy_lost_s);
    to.setValue("alarms/battery_low_percent", limits.battery_low_percent);
    to.setValue("alarms/battery_critical_percent", limits.battery_critical_percent);
    to.setValue("alarms/off_track_m", limits.off_track_m);
    to.setValue("alarms/modem_hot_c", limits.modem_hot_c);
    to.setValue("alarms/duty_percent", limits.duty_percent);
    write_boat(to, {}, memory);
    for (const auto& [name, boat] : memory.more_boats) write_boat(to, group_of(name), boat);
    to.setValue("window/geometry", memory.geometry);
    to.setValue("window/split", memory.split);
    to.setValue("window/tab", memory.tab);
    to.setValue("chart/follow", memory.follow);
    to.setValue("chart/tail_s", memory.tail_s);
    if (memory.chart_centre) to.setValue("chart/centre", words_of(*memory.chart_centre));
    to.setValue("chart/metres_per_pixel", memory.metres_per_pixel);
    to.sync(); // through a temporary file beside it
    if (to.status() != QSettings::NoError) return QObject::tr("cannot save the settings: cannot write %1").arg(path_);
    saved_ = memory;
    return {};
}

} // namespace atirma::console
