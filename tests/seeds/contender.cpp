#include "contender.hpp"

#include <ise/core/sleep.hpp>
#include <ise/naming/name_servers.hpp>
#include <ise/service/session.hpp>

namespace seeds {

using namespace std::chrono_literals;

contender::contender(stage& of, ise::environment& env, std::string path, std::uint64_t life)
    : stage_(of), env_(env), path_(std::move(path)), life_(life), host_(env.make_loop("contender")) {
    auto& on = host_->loop();
    scope_.emplace(on, [this](const std::string& name, std::exception_ptr thrown) {
        stage_.events.broken("{} of a contender for '{}' throws: {}", name, path_, ise::describe(thrown));
    });
    ise::wire::identity self;
    self.host_name = env.identity().host_name;
    self.process_key = env.identity().process_key;
    self.incarnation = env.random() | 1;
    services_.emplace(env, on, *scope_, self, ise::service_options(), ise::logger(env, "contender", {}));
    names_.emplace(*services_, ise::usual_name_servers(env).value(), stage_.plan.lease);
    scope_->spawn("contends", contend());
    stage_.contenders.push_back(this);
}

contender::~contender() {
    std::erase(stage_.contenders, this);
    host_->end();
}

ise::task<> contender::contend() {
    census::citizen here(stage_.coroutines[life_]);
    ise::sim::generator draw(stage_.plan.seed, fmt::format("contender {} {}", path_, life_));
    auto some = [&draw](std::uint64_t max_ms) { return std::chrono::milliseconds(draw.below(max_ms) + 1); };
    for (;;) {
        co_await ise::sleep_for(host_->loop(), some(3000));
        ise::registration who;
        who.path = path_;
        who.incarnation = incarnation_ = env_.random() | 1;
        who.state = "ready";
        who.endpoints = {ise::endpoint{ise::protocol::tcp, env_.interface_addresses().front(), 9000, {}}};
        auto got = co_await names_->enroll(who, some(8000));
        stage_.events.note("contender {} for '{}': {}", life_, path_,
                           got ? fmt::format("epoch {}", *got) : std::string(ise::name_of(got.error().code())));
        stage_.events.tally(got ? "names won" : fmt::format("names not won: {}", ise::name_of(got.error().code())));
        co_await ise::sleep_for(host_->loop(), some(draw.chance(0.3) ? 20'000 : 2000));
        co_await names_->withdraw(path_, incarnation_);
    }
}

void contender::stop() {
    services_->stop(500ms);
    scope_->stop();
}

} // namespace seeds
