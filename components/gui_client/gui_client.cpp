#include <components/gui_client/gui_client.hpp>

#include <components/boat/find_component.hpp>

#include <fmt/format.h>

namespace atirma::console {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration first_pause = 500ms, longest_pause = 5s;
ise::duration longer(ise::duration pause) { return std::min<ise::duration>(2 * pause, longest_pause); }
} // namespace

/// A stream that was made: whether it is connected shows only here, since it heals by itself.
struct gui_client::stream_watch {
    gui_client& self;
    std::string path;
    stream_watch(gui_client& of, std::string at, std::function<bool()> connected) : self(of), path(std::move(at)) {
        self.connected_[path] = std::move(connected);
    }
    stream_watch(const stream_watch&) = delete;
    stream_watch& operator=(const stream_watch&) = delete;
    ~stream_watch() { self.connected_.erase(path); }
};

gui_client::gui_client(gui_client_options options)
    : options_(std::move(options)),
      state_(std::make_unique<console_state>(options_.state)) {
    if (!options_.port) options_.port = std::make_shared<operator_port>();
}
gui_client::~gui_client() { options_.port->close(); }

utc_time gui_client::clock() const { return std::chrono::floor<std::chrono::milliseconds>(wall()); }

ise::task<> gui_client::run() {
    state_ = std::make_unique<console_state>(options_.state);
    followed_.clear();
    connected_.clear();
    trouble_.clear();
    present_.clear();
    looked_at_.clear();
    commands_in_hand_ = 0;
    uploading_ = cancel_upload_ = false;
    struct closing {
        gui_client& self;
        ~closing() { self.options_.port->close(); }
    } guard{*this};
    options_.port->open(on().gate(), [this] { carry_out(); });
    require(services::telemetry);
    require(services::telecommand);
    require(services::telecommand_state);
    require(services::xb_local);
    require(services::xb_local_param);
    for (const auto& path : options_.proxies)
        follow(path, {"telemetry", "telecommand", "telecommand_state", "xb_local"});
    if (options_.name_server) spawn("names", watch_names());
    for (;;) {
        publish_snapshot();
        co_await sleep(options_.tick);
    }
}

void gui_client::publish_snapshot() {
    watch_streams();
    if (!dirty_ && now() - published_ < options_.longest_quiet && published_ != ise::time_point{}) return;
    dirty_ = false;
    published_ = now();
    state_->on_time(clock());
    options_.port->publish(state_->view(clock()));
}

void gui_client::follow(const std::string& path, const std::set<std::string>& services) {
    if (followed_.size() >= options_.state.max_links && !followed_.contains(path)) {
        log().warning("too many proxies: this one is not followed", {{"path", path}});
        return;
    }
    auto& known = followed_[path];
    auto fresh = [&](const char* service) { return services.contains(service) && known.insert(service).second; };
    if (fresh("telecommand")) state_->takes_commands(path);
    if (fresh("telemetry")) spawn("telemetry of " + path, follow_telemetry(path));
    if (fresh("telecommand_state")) spawn("telecommands of " + path, follow_commands(path));
    if (fresh("xb_local")) spawn("modem of " + path, follow_modem(path));
}

ise::task<> gui_client::follow_telemetry(std::string path) {
    auto proxy = find_component(*this, path);
    auto pause = first_pause;
    trouble_[path] = "is looked for";
    for (;;) {
        try {
            auto packets = co_await proxy.subscribe(services::telemetry, ise::subscribe_options::last(512));
            pause = first_pause;
            stream_watch listed(*this, path, [&packets] { return packets.connected(); });
            for (;;) {
                auto packet = co_await packets.next();
                if (!packet) break;
                auto lost = packet.lost_before();
                if (lost != 0 && lost != ise::unknown_gap) state_->on_lost(path, lost);
                state_->on_telemetry(path, *packet, clock());
                news();
            }
            trouble_[path] = packets.cause().message();
        } catch (const ise::error& problem) {
            if (problem.code() == ise::errc::cancelled) throw;
            trouble_[path] = problem.what();
        }
        co_await sleep(pause);
        pause = longer(pause);
    }
}

ise::task<> gui_client::follow_commands(std::string path) {
    auto proxy = find_component(*this, path);
    auto pause = first_pause;
    follow_telecommand everybodys;
    for (;;) {
        try {
            auto states =
                co_await proxy.subscribe(services::telecommand_state, everybodys, ise::subscribe_options::last(256));
            pause = first_pause;
            for (const auto& open : states.response().now) state_->on_status(path, open, clock());
            for (;;) {
                auto state = co_await states.next();
                if (!state) break;
                state_->on_status(path, *state, clock());
                news();
            }
        } catch (const ise::error& problem) { // telemetry tells of it
            if (problem.code() == ise::errc::cancelled) throw;
        }
        co_await sleep(pause);
        pause = longer(pause);
    }
}

ise::task<> gui_client::follow_modem(std::string path) {
    auto proxy = find_component(*this, path);
    auto pause = first_pause;
    for (;;) {
        bool has_none = false;
        try {
            auto locals = co_await proxy.subscribe(services::xb_local, ise::subscribe_options::latest());
            pause = first_pause;
            for (;;) {
                auto local = co_await locals.next();
                if (!local) break;
                state_->on_xbee(path, *local, clock());
                news();
            }
        } catch (const ise::error& problem) {
            if (problem.code() == ise::errc::cancelled) throw;
            has_none = problem.code() == ise::errc::no_such_service; // another link's proxy
        }
        if (has_none) co_return;
        co_await sleep(pause);
        pause = longer(pause);
    }
}

void gui_client::watch_streams() {
    for (const auto& [path, services] : followed_) {
        if (!services.contains("telemetry")) continue;
        auto found = connected_.find(path);
        bool is = found != connected_.end() && found->second();
        const auto& links = state_->links();
        auto known = links.find(path);
        bool was = known != links.end() && known->second.connected;
        if (is != was) news();
        state_->on_link(path, is,
                        is                          ? std::string()
                        : found != connected_.end() ? std::string("its proxy is not reached")
                                                    : trouble_[path],
                        clock());
    }
    finding_view finding;
    finding.uses_names = options_.name_server.has_value();
    finding.where = options_.name_server ? options_.name_server->text() : std::string();
    for (const auto& path : options_.proxies) finding.where += (finding.where.empty() ? "" : ", ") + path;
    finding.looking_for = "telemetry below " + options_.space;
    finding.reached = names_connected_ && names_connected_();
    finding.trouble = finding.reached    ? std::string()
                      : names_connected_ ? std::string("it is not reached")
                                         : names_trouble_;
    state_->on_finding(std::move(finding));
}

} // namespace atirma::console
