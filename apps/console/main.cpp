// The operator's console of A-Tirma. The node runs on threads of its own; the windows never wait for it.
#include "console_window.hpp"

#include <apps/program_options.hpp>
#include <components/boat/boat_names.hpp>
#include <components/curl/curl_http_client.hpp>
#include <components/curl/smtp_sender.hpp>
#include <components/gui_client/gui_client.hpp>

#include <ise/component/node.hpp>
#include <ise/core/complain.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/naming/name_servers.hpp>
#include <ise/naming/services.hpp>

#include <QApplication>
#include <QTimer>
#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <string_view>

// g++ 12 reports alternatives that an action does not hold as uninitialised.
#if defined(__GNUC__) && !defined(__clang__)
    #pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

namespace {

struct arguments {
    std::string name_server, operator_name, boat, screenshot, size, tab, settings;
    std::vector<std::string> spaces{std::string(atirma::first_boat)};
    std::size_t boats = 1;
    std::string alarm_player, alarm_hook, mail_server, mail_user, mail_from, alarms_from = "critical";
    std::vector<std::string> mail_to;
    std::vector<std::string> proxies, fences;
    bool night = false;
    double after_s = 10;
};

constexpr std::size_t max_boats = 100;
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

/// The namespaces of the boats, each once.
std::vector<std::string> spaces_of(const arguments& given) {
    auto all = given.spaces;
    for (std::size_t number = 1; number <= given.boats && given.boats > 1; ++number)
        if (auto space = atirma::boat_name(number); std::ranges::find(all, space) == all.end()) all.push_back(space);
    return all;
}

/// The names of the boats for people, in the order of `spaces`.
QStringList names_of(const arguments& given, const std::vector<std::string>& spaces) {
    QStringList made;
    for (const auto& space : spaces) {
        bool plain = spaces.size() == 1 || space == atirma::first_boat;
        if (made.empty() && !given.boat.empty()) made << QString::fromStdString(given.boat);
        else made << (plain ? QStringLiteral("A-Tirma") : QString::fromStdString(space));
    }
    return made;
}

/// Of `--fence FILE`, for all boats, or `--fence NAMESPACE=FILE`.
struct fence_option {
    std::optional<std::size_t> boat; ///< empty: all boats
    std::string file;
};

/// Throws if two files are given for all boats, or for one of them.
std::vector<fence_option> fences_of(const arguments& given, const std::vector<std::string>& spaces) {
    std::vector<fence_option> made;
    for (const auto& words : given.fences) {
        fence_option one{std::nullopt, words};
        auto split = words.find('=');
        if (auto named = std::ranges::find(spaces, words.substr(0, split));
            split != std::string::npos && named != spaces.end())
            one = {static_cast<std::size_t>(named - spaces.begin()), words.substr(split + 1)};
        if (std::ranges::any_of(made, [&](const auto& before) { return before.boat == one.boat; }))
            throw ise::error(ise::errc::invalid_argument,
                             fmt::format("--fence names two files for {}: '{}' is the second",
                                         one.boat ? "the boat " + spaces[*one.boat] : "all boats", one.file));
        made.push_back(std::move(one));
    }
    return made;
}

/// Of each boat: the coast, and its own fence or that of all boats.
std::vector<std::shared_ptr<const atirma::sea_limits>> limits_of(const arguments& given,
                                                                 const std::vector<std::string>& spaces,
                                                                 ise::environment& world) {
    auto of_all = atirma::sea_limits::coast_only();
    std::vector<std::shared_ptr<const atirma::sea_limits>> own(spaces.size());
    for (const auto& [boat, file] : fences_of(given, spaces)) {
        auto text = world.read_file(file, atirma::geofence::max_bytes + 1).value();
        (boat ? own[*boat] : of_all) =
            std::make_shared<const atirma::sea_limits>(atirma::geofence::parse(text, file).value());
    }
    for (auto& limits : own)
        if (!limits) limits = of_all;
    return own;
}

void set_outlets(atirma::console::alarm_outlet_options& to, const arguments& given) {
    using atirma::console::severity;
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
    if (terms.use_names) {
        options.name_servers = given.name_server.empty() ? ise::usual_name_servers(world).value()
                                                         : ise::parse_name_servers(given.name_server).value();
        terms.name_servers = options.name_servers;
    }
    set_outlets(options.outlets, given);
    ise::node node(world, std::move(terms));
    auto who = given.operator_name.empty()
                   ? fmt::format("{}-{}", variable("USER").empty() ? "operator" : variable("USER"),
                                 world.identity().process_id)
                   : given.operator_name;
    auto spaces = spaces_of(given);
    auto names = names_of(given, spaces);
    auto limits = limits_of(given, spaces, world);
    std::vector<std::shared_ptr<atirma::console::operator_port>> ports;
    std::vector<std::string> paths;                            ///< of the components, by boat
    for (std::size_t boat = 0; boat < spaces.size(); ++boat) { // a component for each: no code there knows another boat
        auto own = options;
        own.space = spaces[boat];
        own.communication = own.space + "/communication";
        if (boat == 0) own.proxies = given.proxies;
        own.state.sea = limits[boat];
        own.outlets.boat = names[static_cast<int>(boat)].toStdString();
        own.port = std::make_shared<atirma::console::operator_port>();
        ports.push_back(own.port);
        paths.push_back(own.space + "/console/" + path_part(who));
        node.start<atirma::console::gui_client>(paths.back(), ise::component_options(), own);
    }

    atirma::console::window_options look;
    look.night = given.night;
    look.alarm_player = pictures ? QStringLiteral("none") : QString::fromStdString(given.alarm_player);
    look.boats = names;
    if (given.settings != "none" && !(pictures && given.settings.empty())) // a picture does not use personal settings
        look.settings =
            given.settings.empty() ? atirma::console::settings_file::usual() : QString::fromStdString(given.settings);
    int code = 0;
    {
        atirma::console::console_window window(
            [ports](std::size_t boat, atirma::console::action what) { return ports.at(boat)->act(std::move(what)); },
            look);
        if (size) window.resize(*size);
        else if (!window.was_here()) window.resize(1280, 800);
        if (!given.tab.empty()) window.show_tab(QString::fromStdString(given.tab));
        window.attach(ports);
        window.show();
        for (int sign : {SIGINT, SIGTERM}) std::signal(sign, [](int) { asked_to_end = 1; });
        QTimer watching;
        std::size_t reported = 0;
        QObject::connect(&watching, &QTimer::timeout, &window, [&] {
            if (asked_to_end) QApplication::quit(); // closes the window first, which saves its settings
            auto reports = node.reports();
            for (; reported < reports.size(); ++reported) {
                const auto& ended = reports[reported];
                auto boat = std::ranges::find(paths, ended.path);
                if (boat == paths.end()) continue;
                window.end_boat(
                    static_cast<std::size_t>(boat - paths.begin()),
                    QString::fromStdString(ended.failure.empty() ? "its component stopped" : ended.failure));
            }
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
    command_line::app app{"The operator's console of A-Tirma", "atirma_console"};
    app.set_version_flag("--version", "atirma_console " ATIRMA_VERSION);
    app.add_option("--name-server", given.name_server,
                   "its endpoint, or none (default: ISE_NAME_SERVER, else that of this machine)");
    app.add_option("--namespace", given.spaces, "namespace of the boat to show; of several boats: their namespaces")
        ->delimiter(',')
        ->capture_default_str();
    app.add_option("--boats", given.boats, "of a fleet, show so many boats: atirma, boat-2, boat-3...")
        ->check(command_line::range(std::size_t{1}, max_boats))
        ->capture_default_str();
    app.add_option("--proxies", given.proxies, "further proxies of the (first) boat: paths or endpoints")
        ->delimiter(',');
    app.add_option("--name", given.operator_name, "your name, shown to the other operators (default: the user name)");
    app.add_option("--boat-name", given.boat, "name of the (first) boat in the window (default: A-Tirma)");
    app.add_flag("--night", given.night, "start with night colours");
    app.add_option("--size", given.size, "size of the window (default: the last one, else 1280x800)");
    app.add_option("--tab", given.tab, "the list shown first: mission, links, boat, log, alarms, packets, who, fleet")
        ->check(command_line::is_member({"mission", "links", "boat", "log", "alarms", "packets", "who", "fleet"}));
    app.add_option("--settings", given.settings,
                   "file for window, units, alarm limits and the edited list, or none "
                   "(default: atirma/console.ini in the user's configuration folder)");
    app.add_option("--fence", given.fences,
                   "GeoJSON file of the area that the boats do not leave, or NAMESPACE=FILE for one boat")
        ->type_name("[NAMESPACE=]FILE")
        ->delimiter(',');
    app.add_option("--alarm-player", given.alarm_player,
                   "program that plays a WAV file, or none (default: pw-play, paplay or aplay)");
    app.add_option("--alarm-hook", given.alarm_hook, "URL of a web hook that gets each alarm (POST, JSON)");
    app.add_option("--alarm-mail", given.mail_to, "addresses that get a mail for each alarm")->delimiter(',');
    app.add_option("--smtp", given.mail_server, "smtps://server for these mails");
    app.add_option("--mail-user", given.mail_user, "user there; the password is in ATIRMA_MAIL_PASSWORD");
    app.add_option("--mail-from", given.mail_from, "sender of these mails");
    app.add_option("--alarms-from", given.alarms_from, "the least severity that is sent: notice, warning, critical")
        ->check(command_line::is_member({"notice", "warning", "critical"}))
        ->capture_default_str();
    app.add_option("--screenshot", given.screenshot,
                   "write a picture of the window to this file (PNG), then exit; needs no display");
    app.add_option("--after", given.after_s, "seconds until the picture")
        ->check(command_line::range(0.1, 86400.0))
        ->capture_default_str();
    app.footer("Exit codes: 0 success, 1 failure, 2 wrong arguments.\n"
               "Example: atirma_console --name-server tcp://shore:7400 --night");
    try {
        app.parse(count, words);
    } catch (const command_line::parse_error& why) {
        return app.exit(why);
    }
    try {
        for (const auto& at : {given.name_server, variable("ISE_NAME_SERVER")})
            if (!at.empty() && at != "none") ise::parse_name_servers(at).value();
        for (const auto& proxy : given.proxies)
            if (proxy.find("://") != std::string::npos) ise::endpoint::parse(proxy).value();
            else if (!ise::naming::is_path(proxy))
                throw ise::error(ise::errc::invalid_argument,
                                 fmt::format("'{}' is neither a path nor an endpoint", proxy));
        for (const auto& space : given.spaces) {
            if (!ise::naming::is_path(space))
                throw ise::error(ise::errc::invalid_argument, fmt::format("'{}' is not a namespace", space));
            if (std::ranges::count(given.spaces, space) > 1)
                throw ise::error(ise::errc::invalid_argument, fmt::format("--namespace has '{}' twice", space));
        }
        auto spaces = spaces_of(given);
        if (spaces.size() > max_boats)
            throw ise::error(ise::errc::invalid_argument,
                             fmt::format("{} boats are given; one console shows {} at most", spaces.size(), max_boats));
        fences_of(given, spaces);
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
