#pragma once
#include <components/boat/telemetry_store.hpp>

#include <ise/component/component.hpp>

#include <memory>
#include <string>

namespace atirma {

/// Gives packets to a store until it has them. Used on the loop of its component, which outlives it.
class telemetry_keeper {
public:
    /// `meanwhile`: what failing means, for the log: "telemetry waits".
    telemetry_keeper(ise::component& of, std::shared_ptr<telemetry_store> store, std::string meanwhile)
        : of_(of), store_(std::move(store)), meanwhile_(std::move(meanwhile)) {}

    /// Completes once the store has all of them; tries again after 250 ms, doubling to 10 s. Each trouble is logged
    /// once. Cancellation: terminal.
    ise::task<> keep(std::vector<telemetry_packet> packets);
    /// Why packets are not kept now; empty where they are.
    const std::string& trouble() const noexcept { return trouble_; }

private:
    ise::component& of_;
    std::shared_ptr<telemetry_store> store_;
    std::string meanwhile_;
    std::string trouble_;
};

} // namespace atirma
