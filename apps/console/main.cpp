// The operator's console of A-Tirma. The node runs on threads of its own; the windows never wait for it.
#include "console_window.hpp"

#include <apps/program_options.hpp>
#include <components/curl/curl_http_client.hpp>
#include <components/curl/smtp_sender.hpp>
#include <components/gui_client/gui_client.hpp>

#include <ise/component/node.hpp>
#include <ise/core/complain.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/naming/name_servers.hpp>
#include <ise/naming/services.hpp>

#include <CLI/CLI.hpp>
#include <QApplication>
#include <QTimer>
#include <fmt/format.h>

#include <csignal>
#include <cstdlib>
#include <string_view>

// g++ 12 reports alternatives that an action does not hold as uninitialised.
#if defined(__GNUC__) && !defined(__clang__)
    #pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

namespace {

struct arguments {
    std::string name_server, space = "atirma", operator_name, boat = "A-Tirma", screenshot, size, tab, settings;
    std::string fence, alarm_player, alarm_hook, mail_server, mail_user, mail_from, alarms_from = "critical";
    std::vector<std::string> mail_to;
    std::vector<std::string> proxies;
    bool night = false;
    double after_s = 10;
};

volatile std::sig_atomic_t asked_to_end = 0;

void complain(std::string_view what) { ise::complain("atirma_console", what); }

std::string variable(const char* name) {
    const char* value = std::getenv(name);
    return value ? value : "";
}

/// A name for paths: letters, digits, '-', '_' and '.'.
std::string path_part(std::string from) {
    for (auto& c : from)
        if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '_' && c != '.') c = '-';
    return from.substr(0, 60);
}

std::optional<QSize> size_of(const std::string& words) {
    unsigned wide = 0, tall = 0;
    char rest = 0;
    if (std::sscanf(words.c_str(), "%5ux%5u%c", &wide, &tall, &rest) != 2 || wide < 640 || tall < 400 || wide > 8000 ||
        tall > 8000)
        return std::nullopt;
    return QSize(static_cast<int>(wide), static_cast<int>(tall));
}

/// A client of libcurl with the transfers that it runs on.
template <class Base, class Client>
struct on_curl : Base {
    template <class Options>
    on_curl(ise::loop& on, Options options) : transfers(on), client(transfers, std::move(options)) {}
    atirma::curl_transfers transfers;
    Client client;
};
struct curl_mail final : on_curl<atirma::mail_sender, atirma::smtp_sender> {
    using on_curl::on_curl;
    ise::task<ise::result<void>> send(atirma::mail_message what) override { return client.send(std::move(what)); }
};
struct curl_hook final : on_curl<ise::http_client, atirma::curl_http_client> {
    using on_curl::on_curl;
    ise::task<ise::result<ise::http_answer>> exchange(ise::http_exchange what, ise::duration within) override {
        return client.exchange(std::move(what), within);
    }
};

void set_outlets(atirma::console::alarm_outlet_options& to, const arguments& given) {
    using atirma::console::severity;
    to.boat = given.boat;
    to.at_least = given.alarms_from == "notice"    ? severity::notice
                  : given.alarms_from == "warning" ? severity::warning
                                                   : severity::critical;
    if (!given.alarm_hook.empty()) {
        to.hook_url = given.alarm_hook;
        to.make_http_client = [](ise::loop& on) -> std::unique_ptr<ise::http_client> {
            return std::make_unique<curl_hook>(on, atirma::curl_http_options());
        };
    }
    if (given.mail_to.empty()) return;
    to.mail_to = given.mail_to;
    to.mail_from = given.mail_from;
    atirma::smtp_options smtp;
    smtp.server = given.mail_server;
    smtp.user = given.mail_user;
    smtp.password = variable("ATIRMA_MAIL_PASSWORD");
    to.make_mail_sender = [smtp](ise::loop& on) -> std::unique_ptr<atirma::mail_sender> {
        return std::make_unique<curl_mail>(on, smtp);
    };
}

int run(const arguments& given, int count, char** words) {
    auto size = given.size.empty() ? std::nullopt : size_of(given.size);
    bool pictures = !given.screenshot.empty();
    if (pictures && variable("QT_QPA_PLATFORM").empty()) qputenv("QT_QPA_PLATFORM", "offscreen");
    if (variable("QT_QPA_PLATFORM").empty() && variable("DISPLAY").empty() && variable("WAYLAND_DISPLAY").empty()) {
        complain("no display: log in to a desktop, set DISPLAY, or serve it over the network with "
                 "QT_QPA_PLATFORM=vnc");
        return 1;
    }
    QApplication app(count, words);
    QApplication::setApplicationName("atirma_console");

    ise::real_environment world;
    ise::node_options terms;
    terms.name = "console";
    terms.log = ise::log_to_stderr(ise::log_level::warning);
    terms.use_names = given.name_server != "none";
    atirma::console::gui_client_options options;
    options.space = given.space;
    options.communication = given.space + "/communication";
    options.proxies = given.proxies;
    if (terms.use_names) {
        options.name_servers = given.name_server.empty() ? ise::usual_name_servers(world).value()
                                                         : ise::parse_name_servers(given.name_server).value();
        terms.name_servers = options.name_servers;
    }
    if (!given.fence.empty()) {
        auto text = world.read_file(given.fence, atirma::geofence::max_bytes + 1).value();
        options.state.sea =
            std::make_shared<const atirma::sea_limits>(atirma::geofence::parse(text, given.fence).value());
    }
    set_outlets(options.outlets, given);
    auto port = options.port;
    ise::node node(world, std::move(terms));
    auto who = given.operator_name.empty()
                   ? fmt::format("{}-{}", variable("USER").empty() ? "operator" : variable("USER"),
                                 world.identity().process_id)
                   : given.operator_name;
    ise::component_options here;
    node.start<atirma::console::gui_client>(given.space + "/console/" + path_part(who), here, options);

    atirma::console::window_options look;
    look.night = given.night;
    look.alarm_player = pictures ? QStringLiteral("none") : QString::fromStdString(given.alarm_player);
    look.boat_name = QString::fromStdString(given.boat);
    if (given.settings != "none" && !(pictures && given.settings.empty())) // a picture does not use personal settings
        look.settings =
            given.settings.empty() ? atirma::console::settings_file::usual() : QString::fromStdString(given.settings);
    int code = 0;
    {
        atirma::console::console_window window(
            [port](atirma::console::action what) { return port->act(std::move(what)); }, look);
        if (size) window.resize(*size);
        else if (!window.was_here()) window.resize(1280, 800);
        if (!given.tab.empty()) window.show_tab(QString::fromStdString(given.tab));
        window.attach(port);
        window.show();
        for (int sign : {SIGINT, SIGTERM}) std::signal(sign, [](int) { asked_to_end = 1; });
        QTimer watching;
        bool reported = false;
        QObject::connect(&watching, &QTimer::timeout, &window, [&] {
            if (asked_to_end) QApplication::quit(); // closes the window first, which saves its settings
            if (reported || !node.all_stopped()) return;
            reported = true;
            for (const auto& report : node.reports())
                window.say("The connection has ended: " + QString::fromStdString(report.failure));
        });
        watching.start(200);
        if (pictures)
            QTimer::singleShot(static_cast<int>(given.after_s * 1000), &window, [&] {
                if (!window.grab().save(QString::fromStdString(given.screenshot))) {
                    complain("the picture cannot be written: " + given.screenshot);
                    code = 1;
                }
                QApplication::quit();
            });
        auto ended = QApplication::exec();
        if (code == 0) code = ended;
    }
    node.stop();
    node.wait();
    return code;
}

} // namespace

int main(int count, char** words) {
    arguments given;
    CLI::App app{"The operator's console of A-Tirma"};
    app.formatter(std::make_shared<wrapped_help>());
    app.set_version_flag("--version", "atirma_console " ATIRMA_VERSION);
    app.add_option("--name-server", given.name_server,
                   "its endpoint, or none (default: ISE_NAME_SERVER, else that of this machine)");
    app.add_option("--namespace", given.space, "namespace of the components to show")->capture_default_str();
    app.add_option("--proxies", given.proxies, "further proxies: paths or endpoints")->delimiter(',');
    app.add_option("--name", given.operator_name, "your name, shown to the other operators (default: the user name)");
    app.add_option("--boat-name", given.boat, "name of the boat in the window's title")->capture_default_str();
    app.add_flag("--night", given.night, "start with night colours");
    app.add_option("--size", given.size, "size of the window (default: the last one, else 1280x800)");
    app.add_option("--tab", given.tab, "the list shown first: mission, links, boat, log, alarms, packets, who")
        ->check(CLI::IsMember({"mission", "links", "boat", "log", "alarms", "packets", "who"}));
    app.add_option("--settings", given.settings,
                   "file for window, units, alarm limits and the edited list, or none "
                   "(default: atirma/console.ini in the user's configuration folder)");
    app.add_option("--fence", given.fence, "GeoJSON file of the area that the boat does not leave");
    app.add_option("--alarm-player", given.alarm_player,
                   "program that plays a WAV file, or none (default: pw-play, paplay or aplay)");
    app.add_option("--alarm-hook", given.alarm_hook, "URL of a web hook that gets each alarm (POST, JSON)");
    app.add_option("--alarm-mail", given.mail_to, "addresses that get a mail for each alarm")->delimiter(',');
    app.add_option("--smtp", given.mail_server, "smtps://server for these mails");
    app.add_option("--mail-user", given.mail_user, "user there; the password is in ATIRMA_MAIL_PASSWORD");
    app.add_option("--mail-from", given.mail_from, "sender of these mails");
    app.add_option("--alarms-from", given.alarms_from, "the least severity that is sent: notice, warning, critical")
        ->check(CLI::IsMember({"notice", "warning", "critical"}))
        ->capture_default_str();
    app.add_option("--screenshot", given.screenshot,
                   "write a picture of the window to this file (PNG), then exit; needs no display");
    app.add_option("--after", given.after_s, "seconds until the picture")
        ->check(CLI::Range(0.1, 86400.0))
        ->capture_default_str();
    app.footer("Exit codes: 0 success, 1 failure, 2 wrong arguments.\n"
               "Example: atirma_console --name-server tcp://shore:7400 --night");
    try {
        app.parse(count, words);
    } catch (const CLI::ParseError& why) {
        return app.exit(why) == 0 ? 0 : 2; // prints help or the error
    }
    try {
        for (const auto& at : {given.name_server, variable("ISE_NAME_SERVER")})
            if (!at.empty() && at != "none") ise::parse_name_servers(at).value();
        for (const auto& proxy : given.proxies)
            if (proxy.find("://") != std::string::npos) ise::endpoint::parse(proxy).value();
            else if (!ise::naming::is_path(proxy))
                throw ise::error(ise::errc::invalid_argument,
                                 fmt::format("'{}' is neither a path nor an endpoint", proxy));
        if (!ise::naming::is_path(given.space))
            throw ise::error(ise::errc::invalid_argument, fmt::format("'{}' is not a namespace", given.space));
    } catch (const ise::error& why) {
        complain(why.what());
        return 2;
    }
    if (!given.mail_to.empty() && (given.mail_server.empty() || given.mail_from.empty())) {
        complain("--alarm-mail also needs --smtp and --mail-from");
        return 2;
    }
    if (!given.size.empty() && !size_of(given.size)) {
        complain("--size: expected WIDTHxHEIGHT such as 1280x800, at least 640x400");
        return 2;
    }
    try {
        return run(given, count, words);
    } catch (const std::exception& why) {
        complain(why.what());
        return 1;
    }
}
