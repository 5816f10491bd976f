#include <components/gui_client/gui_client.hpp>

namespace atirma::console {
namespace {
using namespace std::chrono_literals;
using namespace ise::naming;
constexpr ise::duration question = 5s;
constexpr std::size_t max_present = 500; // that are shown

bool is_of_interest(const std::string& service) {
    return service == services::telemetry.name() || service == services::telecommand.name() ||
           service == services::telecommand_state.name() || service == services::xb_local.name() ||
           service == services::gprs.name() || service == services::iridium_account.name() ||
           service == services::communication.name();
}
} // namespace

ise::task<> gui_client::watch_names() {
    auto server = at(*options_.name_server, std::string(ise::naming::server_path));
    auto pause = 500ms;
    for (;;) {
        try {
            watch_request which;
            which.prefix = options_.space;
            auto changes = co_await server.subscribe(ise::naming::watch, which, ise::subscribe_options::last(256));
            pause = 500ms;
            struct connected {
                gui_client& self;
                ~connected() { self.names_connected_ = nullptr; }
            } guard{*this};
            names_connected_ = [&changes] { return changes.connected(); };
            for (;;) {
                auto told = co_await changes.next();
                if (!told) break;
                if (told.lost_before() != 0 && !told->snapshot) break; // subscribes anew, which begins with a snapshot
                on_names(*told);
                news();
            }
            names_trouble_ = changes.ended() ? changes.cause().message() : std::string();
        } catch (const ise::error& problem) {
            if (problem.code() == ise::errc::cancelled) throw;
            names_trouble_ = problem.what();
        }
        co_await sleep(pause);
        pause = std::min(2 * pause, std::chrono::milliseconds(5000));
    }
}

void gui_client::on_names(const name_events& told) {
    if (told.snapshot) {
        auto before = std::exchange(present_, {});
        for (const auto& event : told.events)
            if (auto known = before.find(event.name.path); known != before.end()) present_.insert(*known);
    }
    for (const auto& event : told.events) {
        const auto& name = event.name;
        if (event.what == name_change::removed) {
            present_.erase(name.path);
            continue;
        }
        if (present_.size() >= max_present && !present_.contains(name.path)) continue;
        auto& shown = present_[name.path];
        if (shown.path.empty()) shown.since = clock();
        shown.path = name.path;
        shown.type = name.type;
        shown.state = name.state;
        shown.host = name.host_name;
        shown.process_id = name.process_id;
        shown.console = lies_below(name.path, options_.space + "/console");
        shown.self = name.path == path();
        if (shown.self || shown.console) continue;
        std::pair as_it_is{name.incarnation, name.services_provided};
        auto& known = looked_at_[name.path];
        if (std::exchange(known, as_it_is) == as_it_is) continue;
        spawn("look at " + name.path, look_at(name.path));
    }
    while (looked_at_.size() > 2 * max_present) looked_at_.erase(looked_at_.begin());
    show_present();
}

void gui_client::show_present() {
    std::vector<present_component> all;
    for (const auto& [path, one] : present_) all.push_back(one);
    state_->on_present(std::move(all));
}

/// Asks what a component provides, and follows it if that is of interest.
ise::task<> gui_client::look_at(std::string path) {
    auto server = at(*options_.name_server, std::string(ise::naming::server_path));
    for (int attempt = 0; attempt < 5; ++attempt) {
        describe_request which;
        which.path = path;
        auto told = co_await server.try_call(ise::naming::describe, which, question);
        if (told) {
            std::set<std::string> provided;
            for (const auto& service : told->services)
                if (service.provided && is_of_interest(service.name)) provided.insert(service.name);
            if (!provided.empty()) follow(path, provided);
            co_return;
        }
        if (told.error().code() == ise::errc::no_such_name) break;
        co_await sleep(1s);
    }
    looked_at_.erase(path); // it has gone, or cannot be asked: the next change is a new chance
}

} // namespace atirma::console
