#include <components/gui_client/gui_client.hpp>

#include <components/boat/find_component.hpp>
#include <components/boat/telemetry_follower.hpp>

// What is listened to: proxies, communication nodes, and the role that these serve together.
namespace atirma::console {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration first_pause = 500ms, max_pause = 5s;
ise::duration longer(ise::duration pause) { return std::min<ise::duration>(2 * pause, max_pause); }
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

template <class Contract, class Told>
ise::task<> gui_client::follow_value(std::string path, Contract service, Told told) {
    auto proxy = find_component(*this, path);
    auto pause = first_pause;
    for (;;) {
        bool has_none = false;
        try {
            auto values = co_await proxy.subscribe(service, ise::subscribe_options::latest());
            pause = first_pause;
            for (;;) {
                auto value = co_await values.next();
                if (!value) break;
                told(*this, path, *value);
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

void gui_client::follow(const std::string& path, const std::set<std::string>& services) {
    if (services.contains("communication_state")) { // it has what all proxies have: the role is followed, not each node
        if (nodes_.size() >= options_.state.max_links || !nodes_.insert(path).second) return;
        state_->on_node(path, false, "is looked for", nullptr, clock());
        spawn("node " + path, follow_node(path));
        follow_role();
        return;
    }
    if (followed_.size() >= options_.state.max_links && !followed_.contains(path)) {
        log().warning("too many proxies: this one is not followed", {{"path", path}});
        return;
    }
    auto& known = followed_[path];
    auto fresh = [&](const char* service) { return services.contains(service) && known.insert(service).second; };
    if (fresh("telecommand")) state_->takes_commands(path);
    if (fresh("telemetry")) spawn("telemetry of " + path, follow_telemetry(path));
    if (fresh("telecommand_state")) spawn("telecommands of " + path, follow_commands(path));
    auto modem = [](gui_client& self, const std::string& of, const xbee_local& local) {
        self.state_->on_xbee(of, local, self.clock());
    };
    if (fresh("xb_local")) spawn("modem of " + path, follow_value(path, services::xb_local, modem));
    auto carrier = [](gui_client& self, const std::string& of, const gprs_state& told) {
        self.state_->on_gprs(of, told, self.clock());
    };
    if (fresh("gprs_state")) spawn("carrier of " + path, follow_value(path, services::gprs, carrier));
    auto account = [](gui_client& self, const std::string& of, const iridium_account& told) {
        self.state_->on_account(of, told, self.clock());
    };
    if (fresh("iridium_account")) spawn("account of " + path, follow_value(path, services::iridium_account, account));
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
                if (lost.value_or(0) != 0) state_->on_lost(path, *lost);
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

ise::task<> gui_client::follow_node(std::string path) {
    auto node = find_component(*this, path);
    auto pause = first_pause;
    trouble_[path] = "is looked for";
    for (;;) {
        try {
            auto states = co_await node.subscribe(services::communication, ise::subscribe_options::latest());
            pause = first_pause;
            stream_watch listed(*this, path, [&states] { return states.connected(); });
            for (;;) {
                auto state = co_await states.next();
                if (!state) break;
                state_->on_node(path, true, std::string(), &*state, clock());
                news();
            }
            trouble_[path] = states.cause().message();
        } catch (const ise::error& problem) {
            if (problem.code() == ise::errc::cancelled) throw;
            trouble_[path] = problem.what();
        }
        co_await sleep(pause);
        pause = longer(pause);
    }
}

/// What the communication nodes know together: the record, everybody's telecommands, the authority.
void gui_client::follow_role() {
    if (std::exchange(role_followed_, true)) return;
    const auto& role = options_.communication;
    followed_[role] = {"telemetry"};
    state_->stands_for_all(role);
    spawn("record", follow_record());
    spawn("telecommands", follow_commands(role));
    auto told = [](gui_client& self, const std::string&, const authority_state& state) {
        self.state_->on_authority(state, self.clock());
    };
    spawn("authority", follow_value(role, services::authority_changes, told));
}

ise::task<> gui_client::follow_record() {
    const auto role = options_.communication;
    telemetry_follower follower(*this, at(role), [this, role](const telemetry_packet& packet) {
        state_->on_telemetry(role, packet, clock());
        news();
    });
    follower.seen = recorded_;
    follower.from = clock() - std::chrono::duration_cast<std::chrono::milliseconds>(options_.look_back);
    stream_watch listed(*this, role, [&follower] { return follower.connected(); });
    auto nodes = at(role);
    record_request last;
    bool knows_commands = false;
    auto pause = first_pause;
    for (;;) {
        if (!knows_commands) { // of before this console was started
            auto given = co_await nodes.try_call(services::telecommand_record, last, 10s);
            knows_commands = given.has_value();
            if (given)
                for (const auto& one : given->entries) state_->on_status(role, one, clock());
            news();
        }
        try {
            co_await follower.run();
            pause = first_pause;
        } catch (const ise::error& problem) {
            if (problem.code() == ise::errc::cancelled) throw;
            trouble_[role] = problem.what();
        }
        recorded_ = follower.seen;
        co_await sleep(pause);
        pause = longer(pause);
    }
}

} // namespace atirma::console
