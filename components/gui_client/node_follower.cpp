#include <components/gui_client/node_follower.hpp>

#include <components/boat/find_component.hpp>
#include <components/boat/telemetry_follower.hpp>
#include <components/gui_client/proxy_follower.hpp>

namespace atirma::console {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration record_deadline = 10s;
} // namespace

node_follower::node_follower(client_context& context, std::string role, ise::duration look_back, std::size_t max_nodes)
    : context_(context), role_(std::move(role)), look_back_(look_back), max_nodes_(max_nodes) {}

void node_follower::follow(const std::string& path) {
    if (nodes_.size() >= max_nodes_) return;
    auto [place, added] = nodes_.try_emplace(path, "is looked for");
    if (!added) return;
    stream_use use(services::communication);
    use.health = &place->second;
    use.on_packet = [this, path](const auto& state) {
        context_.state.on_node(path, true, std::string(), &*state, context_.clock());
        return true;
    };
    context_.state.on_node(path, false, place->second.trouble(), nullptr, context_.clock());
    context_.self.spawn("node " + path, follow_stream(context_, find_component(context_.self, path), std::move(use)));
    if (context_.role.empty()) follow_role();
}

void node_follower::report() {
    for (const auto& [path, health] : nodes_)
        context_.state.on_node(path, health.reached(), health.trouble(), nullptr, context_.clock());
    if (!context_.role.empty()) context_.state.on_link(role_, record_.reached(), record_.trouble(), context_.clock());
}

void node_follower::follow_role() {
    context_.role = role_;
    context_.state.stands_for_all(role_);
    context_.self.spawn("record", follow_record());
    follow_telecommands(context_, role_);
    follow_authority();
}

void node_follower::follow_authority() {
    stream_use use(services::authority_changes);
    use.optional = true;
    use.on_packet = [this](const auto& state) {
        context_.state.on_authority(*state, context_.clock());
        return true;
    };
    context_.self.spawn("authority", follow_stream(context_, context_.self.at(role_), std::move(use)));
}

ise::task<> node_follower::follow_record() {
    auto& self = context_.self;
    auto nodes = self.at(role_);
    telemetry_follower follower(self, nodes, [this](const telemetry_packet& packet) {
        context_.state.on_telemetry(role_, packet, context_.clock());
        context_.news();
    });
    follower.from = context_.clock() - std::chrono::duration_cast<std::chrono::milliseconds>(look_back_);
    stream_health::watch shown(&record_, [&follower] { return follower.connected(); });
    record_request newest;
    bool knows_commands = false;
    back_off pause(self);
    for (;;) {
        if (!knows_commands) { // those of before this console was started
            auto given = co_await nodes.try_call(services::telecommand_record, newest, record_deadline);
            knows_commands = given.has_value();
            if (given)
                for (const auto& one : given->entries) context_.state.on_status(role_, one, context_.clock());
            context_.news();
        }
        try {
            co_await follower.run();
            pause.reset();
        } catch (const ise::error& problem) {
            // Also of a node that stops meanwhile (cancelled): our own end throws at the next suspension.
            record_.set_trouble(problem.what());
        }
        co_await pause.wait();
    }
}

} // namespace atirma::console
