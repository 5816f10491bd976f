#pragma once
#include <components/gprs/uplink_port.hpp>
#include <unit/gprs/packets.hpp>

#include <ise/component/component.hpp>
#include <ise/service/service_host.hpp>

#include <algorithm>
#include <functional>
#include <memory>

namespace gprs_test {

/// What a test tells the boat, and learns of it. Outlives it.
struct boat_log {
    std::string shore; ///< endpoint that it calls
    std::string id = "atirma";
    std::uint16_t boot = 5;
    std::uint32_t fixes = 0; ///< that it measures, then it only keeps the link
    ise::duration period = std::chrono::seconds(2);
    std::uint32_t measured = 0;
    std::size_t waiting = 0;
    std::uint32_t acknowledged = 0;
    std::uint64_t half_open = 0, resent = 0;
    std::string trouble;
    std::vector<std::uint32_t> executed; ///< telecommands, each once, as the boat does it
    std::vector<std::uint32_t> heard;    ///< however often
    bool mute = false;                   ///< answers no telecommand
    std::function<ise::bytes(ise::bytes)> seal;
};

/// A boat that only calls: measures a fix every now and then, takes telecommands.
class caller final : public ise::component {
public:
    explicit caller(boat_log& log) : log_(log) {}

private:
    ise::task<> run() override {
        atirma::gprs::port_options options;
        options.shore = ise::endpoint::parse(log_.shore).value();
        options.security = services().peers().credentials();
        options.link.id = log_.id;
        options.link.seal = log_.seal;
        port_ = std::make_unique<atirma::gprs::uplink_port>(on(), log(), options, log_.boot);
        port_->on_order = [this](const atirma::gprs::order& result) { hear(result); };
        spawn("uplink", port_->run());
        for (std::uint32_t next = 1;;) {
            if (next <= log_.fixes) port_->put(fix(log_.measured = next++, log_.boot));
            note();
            ise::duration pause = std::chrono::milliseconds(100);
            if (next <= log_.fixes) pause = log_.period;
            co_await sleep(pause);
        }
    }
    void hear(const atirma::gprs::order& result) {
        auto command = atirma::parse_telecommand(result.raw);
        if (!command) return; // about the seal
        log_.heard.push_back(result.id);
        if (std::find(log_.executed.begin(), log_.executed.end(), result.id) == log_.executed.end())
            log_.executed.push_back(result.id);
        atirma::acknowledgement ack;
        ack.header.boot = log_.boot;
        ack.id = command->id;
        ack.kind = command->command.kind();
        ack.text = "aye";
        if (!log_.mute) port_->put(atirma::encode_acknowledgement(ack));
    }
    void note() {
        log_.waiting = port_->link().waiting();
        log_.acknowledged = port_->link().acknowledged();
        log_.half_open = port_->link().counters().half_open;
        log_.resent = port_->link().counters().resent;
        log_.trouble = port_->trouble();
    }

    boat_log& log_;
    std::unique_ptr<atirma::gprs::uplink_port> port_;
};

} // namespace gprs_test
