#pragma once
#include "caller.hpp"

#include <components/boat/duplicate_filter.hpp>
#include <components/gprs_proxy/gprs_proxy.hpp>

#include <ise/component/node.hpp>
#include <ise/sim/world.hpp>

#include <cstdlib>
#include <functional>
#include <memory>
#include <optional>

namespace gprs_test {

/// The proxy on one host, a boat on another, a console on a third.
class quay {
public:
    explicit quay(const std::string& protocol = "tcp", std::uint32_t fixes = 5, std::uint64_t seed = 1) : world(seed) {
        boat.shore = protocol + "://shore:7420";
        boat.fixes = fixes;
        options.listen = {"tcp://0.0.0.0:7420", "udp://0.0.0.0:7420"};
    }

    ise::sim::world world;
    atirma::gprs_proxy_options options;
    boat_log boat;
    std::vector<std::string> warnings;                  ///< of the proxy
    std::vector<std::unique_ptr<ise::loop_host>> loops; ///< of strangers

    struct watched {
        std::vector<atirma::telemetry_packet> telemetry; ///< each once, also over a restart of the proxy
        std::vector<atirma::telecommand_status> states;
        std::optional<atirma::gprs_state> state;
        std::uint64_t lost = 0, again = 0;
        atirma::duplicate_filter known;
    };
    watched seen;

    void start_proxy() {
        proxy = &world.host("shore").start_process("proxy", [this](ise::sim::process& here) -> std::shared_ptr<void> {
            auto log = [this](const ise::log_record& record) {
                if (record.level >= ise::log_level::warning) warnings.push_back(ise::format_line(record));
            };
            auto node = std::make_shared<ise::node>(here, quiet(log));
            ise::component_options where;
            where.listen = {ise::endpoint::parse("tcp://0.0.0.0:7411").value()};
            node->start<atirma::gprs_proxy>("atirma/shore/gprs", where, options);
            return node;
        });
    }
    void start_boat() {
        craft = &world.host("boat").start_process("boat", [this](ise::sim::process& here) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(here, quiet());
            node->start<caller>("", asks_only(), boat);
            return node;
        });
    }
    void watch() {
        user([this](ise::component& self) -> ise::task<> {
            self.listen(at_proxy(self), atirma::services::telecommand_state,
                        [this](const atirma::telecommand_status& state) { seen.states.push_back(state); });
            self.listen(at_proxy(self), atirma::services::gprs,
                        [this](const atirma::gprs_state& state) { seen.state = state; });
            auto shore = at_proxy(self);
            auto many = ise::subscribe_options::keep_last(10'000);
            auto packets = co_await shore.subscribe(atirma::services::telemetry, many);
            for (;;) {
                auto packet = co_await packets.next();
                if (!packet) break;
                seen.lost += packet.lost_before().value_or(0);
                if (seen.known.first_time(packet->boot, packet->sequence, packet->raw))
                    seen.telemetry.push_back(*packet);
                else ++seen.again;
            }
        });
    }
    /// All of it, in this order.
    void start() {
        start_proxy();
        watch();
        world.run_for(std::chrono::seconds(1));
        start_boat();
    }
    void user(std::function<ise::task<>(ise::component&)> body) {
        world.host("console").start_process("user", [body](ise::sim::process& here) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(here, quiet());
            node->start("", body, asks_only());
            return node;
        });
    }
    using asked = std::optional<ise::result<atirma::telecommand_reply>>;
    void command(std::uint32_t id, asked& into, float valid_s = 300,
                 ise::duration deadline = std::chrono::seconds(20)) {
        atirma::telecommand_request request;
        request.id = id;
        request.valid_s = valid_s;
        user([request, deadline, &into](ise::component& self) -> ise::task<> {
            auto shore = at_proxy(self);
            into = co_await shore.try_call(atirma::services::telecommand, request, deadline);
        });
    }
    /// Everything that the boat measured is there, once, and acknowledged.
    bool complete() const {
        std::vector<bool> there(boat.fixes + 1);
        for (const auto& packet : seen.telemetry)
            if (packet.boot == boat.boot && packet.sequence <= boat.fixes) there[packet.sequence] = true;
        return boat.measured == boat.fixes && boat.waiting == 0 &&
               std::count(there.begin(), there.end(), true) == boat.fixes;
    }
    bool until(const std::function<bool()>& done, ise::duration within = std::chrono::minutes(10)) {
        return world.run_until(done, within);
    }
    bool warned(const std::string& text) const {
        return std::any_of(warnings.begin(), warnings.end(),
                           [&](const auto& line) { return line.find(text) != std::string::npos; });
    }
    /// What is no history is newer than all before it.
    bool never_back() const {
        std::int64_t newest = -1;
        for (const auto& packet : seen.telemetry) {
            if (packet.history) continue;
            if (packet.sequence <= newest) return false;
            newest = packet.sequence;
        }
        return true;
    }

    ise::sim::process* proxy = nullptr;
    ise::sim::process* craft = nullptr;

    static ise::remote at_proxy(ise::component& self) {
        return self.at(ise::endpoint::parse("tcp://shore:7411").value());
    }
    static ise::component_options asks_only() {
        ise::component_options made;
        made.listens = false;
        return made;
    }
    static ise::node_options quiet(ise::log_sink log = {}) {
        ise::node_options made;
        made.use_names = false;
        made.log = std::getenv("ISE_TEST_LOG") ? ise::log_to_stderr(ise::log_level::debug) : std::move(log);
        return made;
    }
};

} // namespace gprs_test
