#pragma once
#include "actions.hpp"
#include "mission_draft.hpp"
#include "recorder.hpp"
#include "settings.hpp"

#include <components/gui_client/fleet_watch.hpp>
#include <components/gui_client/operator_port.hpp>

#include <QMainWindow>
#include <QStringList>

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

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
class choice_box;
class command_button;
class command_list;
class fleet_list;
class helm_bar;
class instrument_panel;
class links_panel;
class mission_panel;
class packet_list;
class present_list;

struct window_options {
    bool night = false;
    QStringList boats{"A-Tirma"};    ///< their names; with more than one there is a list to switch between them
    QString settings;                ///< the file for window, units, limits…; empty: nothing is saved
    QString alarm_player;            ///< plays the sound of alarms (alarm_sound.hpp)
    std::function<utc_time()> clock; ///< civil time; empty: this machine's
};

/// The operator's console: all known values with their ages, and all actions. Never waits for another component. Of
/// several boats it shows one, and the alarms of all.
class console_window : public QMainWindow {
    Q_OBJECT
public:
    /// Passes an action to the component of a boat; see operator_port::act.
    using sink = std::function<bool(std::size_t boat, action)>;
    console_window(sink act, window_options options);
    ~console_window() override;

    /// Shows the ports' snapshots as they arrive, for the lifetime of the window: one port for each boat.
    void attach(std::vector<std::shared_ptr<operator_port>> ports);
    void show_snapshot(std::shared_ptr<const snapshot> seen, std::size_t boat = 0);
    /// The component of that boat has ended, for good: the strip says why, and nothing can be sent to it any more.
    void end_boat(std::size_t boat, const QString& why);
    /// Switches to another boat: the widgets are built anew, so that nothing entered for one boat reaches another.
    void show_boat(std::size_t boat);
    std::size_t shown_boat() const noexcept { return shown_; }
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
    mission_draft& draft() noexcept { return *desks_[shown_].draft; }

    /// Whether the settings contain its position.
    bool was_here() const noexcept { return !remembered_.geometry.isEmpty(); }
    /// The state that is saved for the next start.
    console_memory memory() const;

protected:
    void resizeEvent(QResizeEvent*) override;
    void closeEvent(QCloseEvent*) override;

private:
    /// The state of a boat that is kept while another one is shown.
    struct boat_desk {
        std::unique_ptr<mission_draft> draft = std::make_unique<mission_draft>();
        bool told = false; ///< its component has the saved limits and acknowledged alarms
        std::optional<waypoint> chart_centre;
        double metres_per_pixel = 3;
    };
    void make_middle();
    void connect_middle();
    QWidget* make_boat_choice();
    void take_snapshot(std::size_t boat, std::shared_ptr<const snapshot> seen);
    void take_news();
    void show_fleet(utc_time now);
    void fit_instruments(int height);
    QString boat_name() const;
    QWidget* make_head();
    QWidget* make_alarm_strip();
    QWidget* make_side();
    void make_chart_tools();
    void make_menus();
    void make_units(QMenu* to);
    void show_keys();
    // console_memory.cpp
    void recall();
    boat_memory& memory_of(console_memory& all, std::size_t boat) const;
    void keep_boat(std::size_t boat, boat_memory& into) const;
    void keep();
    void set_units(const units& chosen);
    void edit_limits();
    QAction* add(QMenu* to, const QString& words, const QKeySequence& key, std::function<void()> act);
    void refresh();
    void show_head(utc_time now);
    void show_alarm_strip();
    void acknowledge_first();
    void show_ended();
    void ring();
    void write_alarm_log();
    void use_palette();
    void show_palette();
    void import_route();
    void export_route();
    void export_track(bool gpx);
    void toggle_recording(bool on);
    utc_time now() const;

    window_options options_;
    sink act_;
    fleet_watch fleet_;
    std::vector<boat_desk> desks_;
    std::size_t shown_ = 0, recorded_ = 0; ///< boats
    operator_actions actions_;
    recorder recorder_;
    std::vector<std::shared_ptr<operator_port>> ports_;
    std::atomic<bool> news_posted_{false};
    std::shared_ptr<const snapshot> seen_; ///< of the shown boat
    settings_file settings_{QString()};
    console_memory remembered_; ///< the part that no widget holds
    bool settings_failed_ = false, log_failed_ = false;
    bool red_ = false;
    utc_time began_{};
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
    QMenu* boat_menu_ = nullptr;
    fleet_list* boats_ = nullptr;       ///< null: there is one boat
    choice_box* boat_choice_ = nullptr; ///< likewise
    QTabWidget* tabs_;
    /// The alarm in the strip.
    struct strip_alarm {
        std::size_t boat = 0;
        std::string key;
        severity how = severity::notice;
        utc_time raised_at{};
        bool operator==(const strip_alarm&) const = default;
    };
    std::optional<strip_alarm> in_strip_, pressed_;
    utc_time in_strip_since_{};
    QFrame* strip_;
    QLabel *strip_text_, *status_, *mode_, *record_mark_, *clock_;
    QPushButton *strip_more_, *strip_acknowledge_;
    QAction *night_, *red_action_, *follow_, *measure_, *edit_, *record_;
};

} // namespace atirma::console
