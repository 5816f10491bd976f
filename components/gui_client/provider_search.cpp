#include <components/gui_client/provider_search.hpp>

namespace atirma::console {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration describe_deadline = 5s;
constexpr int describe_attempts = 5;
constexpr std::size_t max_present = 500; // that are shown
} // namespace

provider_search::provider_search(client_context& context, std::string space, std::vector<ise::endpoint> name_servers,
                                 found on_found)
    : context_(context), space_(std::move(space)), name_servers_(std::move(name_servers)),
      on_found_(std::move(on_found)) {}

ise::remote provider_search::server() const {
    return context_.self.at(name_servers_, std::string(ise::naming::server_path));
}

void provider_search::start() {
    if (name_servers_.empty()) return;
    stream_use use(ise::naming::watch);
    use.request.prefix = space_;
    use.options = ise::subscribe_options::keep_last(256);
    use.health = &health_;
    use.on_packet = [this](const auto& result) {
        if (result.lost_before() != 0 && !result->snapshot) return false; // a new subscription begins with a snapshot
        on_names(*result);
        return true;
    };
    context_.self.spawn("names", follow_stream(context_, server(), std::move(use)));
}

void provider_search::on_names(const ise::naming::name_events& result) {
    if (result.snapshot) {
        auto before = std::exchange(present_, {});
        for (const auto& event : result.events)
            if (auto known = before.find(event.name.path); known != before.end()) present_.insert(*known);
    }
    for (const auto& event : result.events) {
        const auto& name = event.name;
        if (event.what == ise::naming::name_change::removed) {
            present_.erase(name.path);
            continue;
        }
        if (present_.size() >= max_present && !present_.contains(name.path)) continue;
        auto& shown = present_[name.path];
        if (shown.path.empty()) shown.since = context_.clock();
        shown.path = name.path;
        shown.type = name.type;
        shown.state = name.state;
        shown.host = name.host_name;
        shown.process_id = name.process_id;
        shown.console = ise::naming::lies_below(name.path, space_ + "/console");
        shown.self = name.path == context_.self.path();
        if (shown.self || shown.console) continue;
        std::pair as_it_is{name.incarnation, name.services_provided};
        auto& known = looked_at_[name.path];
        if (std::exchange(known, as_it_is) == as_it_is) continue;
        context_.self.spawn("look at " + name.path, look_at(name.path));
    }
    while (looked_at_.size() > 2 * max_present) looked_at_.erase(looked_at_.begin());
    std::vector<present_component> all;
    for (const auto& [path, one] : present_) all.push_back(one);
    context_.state.on_present(std::move(all));
}

/// Asks the name server which services a component provides.
ise::task<> provider_search::look_at(std::string path) {
    auto names = server();
    for (int attempt = 0; attempt < describe_attempts; ++attempt) {
        ise::naming::describe_request which;
        which.path = path;
        auto response = co_await names.try_call(ise::naming::describe, which, describe_deadline);
        if (response) {
            std::set<std::string> provided;
            for (const auto& service : response->services)
                if (service.provided) provided.insert(service.name);
            on_found_(path, provided);
            co_return;
        }
        if (response.error().code() == ise::errc::no_such_name) break;
        co_await context_.self.sleep(1s);
    }
    looked_at_.erase(path); // it has gone, or did not answer: its next change starts another look
}

} // namespace atirma::console
