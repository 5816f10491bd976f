#pragma once
#include "hands.hpp"

#include <apps/window_view.hpp>

#include <ise/sim/random.hpp>

#include <QElapsedTimer>
#include <QObject>
#include <QStringList>
#include <QTimer>

#include <chrono>
#include <deque>
#include <functional>
#include <map>

class QMenu;

namespace atirma::console {

class console_window;

struct window_operator_options {
    std::string name;
    std::uint64_t seed = 1;
    bool steers = true;          ///< else asks the boat only, and requests the authority now and then
    std::chrono::seconds length; ///< of the mission: the pauses between telecommands follow from it
    /// Called once, when nothing is undecided after `leave`, or at the end of `patience`.
    std::function<void()> left;
    std::chrono::seconds patience{240};
};

/// An operator at the console's window. Looks at it a few times per second, and then does one thing: answers the open
/// dialog or menu, gives a telecommand when it is time, looks the last ones up in the list, or looks around. What is
/// known of telecommands is read off the list, as a person reads it.
class window_operator : public QObject {
public:
    window_operator(console_window& window, window_operator_options options);

    /// The console accepted a telecommand of the window, or an upload, which is several.
    void accepted(bool one) {
        given_ += one ? 1 : 0;
        unread_ = true;
    }
    /// Gives no more telecommands.
    void leave() {
        if (!leaving_since_.isValid()) leaving_since_.start();
    }
    /// After `left`.
    window_view seen();

private:
    using deed = std::function<void()>;
    void look();
    void act();
    void answer(QWidget& dialog);
    void choose_from(QMenu& menu);
    void read_list();
    bool any_open() const;
    bool course_changes() const;
    void beat();

    void give_telecommand();
    void ask_boat();
    void steer_boat();
    void look_around();
    void upload();
    void set_parameter(const QString& name, double value);
    void open_menu(const QString& title, QStringList path);
    void choose_link();
    void show_list(int number);
    void call_back();

    template <class Widget>
    Widget* find(const QString& name);
    void click(const QString& button);
    std::chrono::milliseconds pause_between_orders();

    console_window& window_;
    window_operator_options options_;
    ise::sim::generator dice_;
    hands hands_;
    bool acting_ = false;
    QStringList path_;      ///< through the menus that open next
    std::deque<deed> next_; ///< telecommands that belong to the last one: Auto after Heading
    QElapsedTimer since_start_, since_order_, since_list_, leaving_since_, since_beat_;
    std::chrono::milliseconds next_order_{};
    QTimer beating_;
    std::uint64_t given_ = 0;
    bool unread_ = false; ///< the last ones have not been looked up in the list
    std::map<std::uint32_t, shown_command> notes_;
    window_view view_;
};

} // namespace atirma::console
