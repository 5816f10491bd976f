// An operator at a window of the console, for missions on the real clock (apps/stress/mission): the windows and the
// component of atirma_console, worked by mouse and keyboard of this program.
#include "window_operator.hpp"

#include <apps/console/console_window.hpp>
#include <apps/program_options.hpp>
#include <components/gui_client/gui_client.hpp>

#include <ise/component/node.hpp>
#include <ise/core/complain.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/naming/name_servers.hpp>
#include <ise/naming/services.hpp>
#include <ise/packet/json.hpp>

#include <QApplication>
#include <QSaveFile>
#include <QTimer>
#include <fmt/format.h>

#include <csignal>
#include <cstdio>
#include <string_view>

namespace {

namespace console = atirma::console;

volatile std::sig_atomic_t asked_to_leave = 0;

void complain(std::string_view what) { ise::complain("atirma_window_operator", what); }

/// Whole or not at all: the mission waits for it.
bool write(const std::string& file, const std::string& text) {
    QSaveFile out(QString::fromStdString(file));
    return out.open(QIODevice::WriteOnly) && out.write(text.data(), static_cast<qint64>(text.size())) >= 0 &&
           out.commit();
}

struct arguments {
    console::window_operator_options who;
    std::string out, picture;
    double length_s = 600;
    bool asks_only = false;
};

int run(const arguments& given, int count, char** words) {
    if (qEnvironmentVariableIsEmpty("QT_QPA_PLATFORM")) qputenv("QT_QPA_PLATFORM", "offscreen");
    // The offscreen platform warns of all that it has not.
    qInstallMessageHandler([](QtMsgType type, const QMessageLogContext&, const QString& text) {
        if (type == QtCriticalMsg || type == QtFatalMsg) complain(text.toStdString());
    });
    QApplication app(count, words);
    ise::real_environment world;
    ise::node_options terms;
    terms.name = given.who.name;
    terms.log = ise::log_to_stderr(ise::log_level::error);
    console::gui_client_options options;
    options.name_servers = ise::usual_name_servers(world).value();
    terms.name_servers = options.name_servers;
    options.port = std::make_shared<console::operator_port>();
    ise::node node(world, std::move(terms));
    node.start<console::gui_client>("atirma/console/" + given.who.name, ise::component_options(), options);

    bool written = false;
    {
        console::window_operator* person = nullptr;
        console::window_options look;
        look.alarm_player = "none";
        auto act = [&person, port = options.port](std::size_t, console::action what) {
            bool one = std::holds_alternative<console::give_command>(what);
            bool several = std::holds_alternative<console::upload_mission>(what);
            bool taken = port->act(std::move(what));
            if (taken && (one || several)) person->accepted(one);
            return taken;
        };
        console::console_window window(act, look);
        window.resize(1280, 800);
        window.attach({options.port});
        window.show();
        fmt::print("the window of {} is open\n", given.who.name);
        std::fflush(stdout);
        auto who = given.who;
        who.left = [] { QApplication::quit(); };
        console::window_operator at(window, who);
        person = &at;
        for (int sign : {SIGINT, SIGTERM}) std::signal(sign, [](int) { asked_to_leave = 1; });
        QTimer watching;
        QObject::connect(&watching, &QTimer::timeout, &window, [&] {
            if (asked_to_leave) at.leave();
            if (!node.reports().empty()) QApplication::quit();
        });
        watching.start(200);
        QApplication::exec();
        auto seen = at.seen();
        auto latest = options.port->latest();
        seen.fix = latest->boat.position.has_value();
        seen.track = latest->track->size();
        seen.packets = latest->packets->empty() ? 0 : latest->packets->back()->number;
        written = (given.picture.empty() || window.grab().save(QString::fromStdString(given.picture))) &&
                  write(given.out, ise::to_json(seen));
        if (!written) complain("cannot write " + given.out + ", or its picture");
        for (const auto& ended : node.reports()) complain("the console's component ended: " + ended.failure);
    }
    bool whole = written && node.reports().empty();
    node.stop();
    node.wait();
    return whole ? 0 : 1;
}

} // namespace

int main(int count, char** words) {
    arguments given;
    command_line::app app(
        "Works the window of an operator's console by mouse and keyboard until SIGTERM, and then writes what it "
        "showed.",
        "atirma_window_operator");
    app.add_option("--name", given.who.name, "of the operator")->required();
    app.add_option("--seed", given.who.seed, "random seed of the operator")->capture_default_str();
    app.add_option("--for", given.length_s, "length of the mission in seconds: sets the pauses between telecommands")
        ->check(command_line::range(10.0, 86400.0))
        ->capture_default_str();
    app.add_flag("--asks-only", given.asks_only, "rarely gives telecommands that need the authority over the boat");
    app.add_option("--out", given.out, "file for what the window showed, as JSON")->required();
    app.add_option("--picture", given.picture, "file for the last picture of the window (PNG)");
    try {
        app.parse(count, words);
        given.who.steers = !given.asks_only;
        given.who.length = std::chrono::seconds(static_cast<std::int64_t>(given.length_s));
        return run(given, count, words);
    } catch (const command_line::parse_error& why) {
        return app.exit(why);
    } catch (const std::exception& why) {
        complain(why.what());
        return 1;
    }
}
