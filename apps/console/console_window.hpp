#pragma once
#include "actions.hpp"
#include "mission_draft.hpp"
#include "recorder.hpp"
#include "settings.hpp"

#include <components/gui_client/operator_port.hpp>

#include <QMainWindow>

#include <atomic>
#include <functional>
#include <memory>
#include <optional>

class QAction;
class QFrame;
class QLabel;
class QMenu;
class QPushButton;
class QSplitter;
class QTabWidget;

namespace atirma::console {

class alarm_list;
class alarm_sound;
class boat_panel;
class chart_view;
class command_button;
class command_list;
class helm_bar;
class instrument_panel;
class links_panel;
class mission_panel;
class packet_list;
class present_list;

struct window_options {
    bool night = false;
    QString boat_name = "A-Tirma";
    QString settings;                ///< the file for window, units, limits…; empty: nothing is saved
    QString alarm_player;            ///< plays the sound of alarms (alarm_sound.hpp)
    std::function<utc_time()> clock; ///< civil time; empty: this machine's
};

/// The operator's console: all known values with their ages, and all actions. Never waits for another component.
class console_window : public QMainWindow {
    Q_OBJECT
public:
    console_window(operator_actions::sink act, window_options options);
    ~console_window() override;

    /// Shows the port's snapshots as they arrive, for the lifetime of the window.
    void attach(std::shared_ptr<operator_port> port);
    void show_snapshot(std::shared_ptr<const snapshot> seen);
    void set_night(bool on);
    void set_red(bool on);
    /// Reads a route into the mission editor. Returns why it was not, or an empty string.
    QString import_route(const QString& path);
    QString export_route(const QString& path) const;
    /// "mission", "links"…
    bool show_tab(const QString& name);
    /// Shows a line at the bottom for some seconds.
    void say(const QString& words);

    chart_view& chart() noexcept { return *chart_; }
    mission_draft& draft() noexcept { return draft_; }

    /// Whether the settings contain its position.
    bool was_here() const noexcept { return !remembered_.geometry.isEmpty(); }
    /// The state that is saved for the next start.
    console_memory memory() const;

protected:
    void resizeEvent(QResizeEvent*) override;
    void closeEvent(QCloseEvent*) override;

private:
    QWidget* make_head();
    QWidget* make_alarm_strip();
    QWidget* make_side();
    void make_chart_tools();
    void make_menus();
    void make_units(QMenu* to);
    void show_keys();
    // console_memory.cpp
    void recall();
    void keep();
    void set_units(const units& chosen);
    void edit_limits();
    QAction* add(QMenu* to, const QString& words, const QKeySequence& key, std::function<void()> act);
    void refresh();
    void show_head(utc_time now);
    void show_alarm_strip();
    void ring();
    void write_alarm_log();
    void use_palette();
    void show_palette();
    void import_route();
    void export_route();
    QString mode_words(utc_time now) const;
    void export_track(bool gpx);
    void toggle_recording(bool on);
    utc_time now() const;

    window_options options_;
    operator_actions actions_;
    mission_draft draft_;
    recorder recorder_;
    std::shared_ptr<operator_port> port_;
    std::atomic<bool> news_posted_{false};
    std::shared_ptr<const snapshot> seen_;
    settings_file settings_{QString()};
    console_memory remembered_; ///< the part that no widget holds
    bool told_component_ = false, settings_failed_ = false, log_failed_ = false;
    bool red_ = false;
    utc_time began_{};
    std::uint64_t calls_heard_ = 0, alarms_logged_ = 0;
    alarm_sound* sound_;
    QSplitter* split_;
    chart_view* chart_;
    command_button* command_;
    instrument_panel* instruments_;
    helm_bar* helm_;
    mission_panel* mission_;
    links_panel* links_;
    boat_panel* boat_;
    command_list* log_;
    alarm_list* alarms_;
    packet_list* packets_;
    present_list* present_;
    QTabWidget* tabs_;
    QFrame* strip_;
    QLabel *strip_text_, *status_, *mode_, *record_mark_, *clock_;
    QPushButton *strip_more_, *strip_acknowledge_;
    QAction *night_, *red_action_, *follow_, *measure_, *edit_, *record_;
};

} // namespace atirma::console
