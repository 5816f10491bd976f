// Calls whose packets are known at run time only, on both sides: what a bridge or a replay pays.
#include "collector.hpp"
#include "programs.hpp"

#include <ise/component/provide_dynamic.hpp>
#include <ise/service/dynamic.hpp>

namespace bench {
namespace {

ise::dynamic_contract contract_of(const options& asked) {
    return asked.size_bytes == telemetry_bytes ? ise::dynamic_contract::of(echo<telemetry>)
                                               : ise::dynamic_contract::of(echo<block>);
}

ise::dynamic_packet packet_of(const options& asked) {
    return asked.size_bytes == telemetry_bytes ? ise::to_dynamic(make_packet<telemetry>(asked.size_bytes))
                                               : ise::to_dynamic(make_packet<block>(asked.size_bytes));
}

class dynamic_server final : public ise::component {
public:
    explicit dynamic_server(options asked) : asked_(std::move(asked)) {}

private:
    ise::task<> run() override {
        auto handler = [](ise::dynamic_packet request) -> ise::task<ise::dynamic_packet> { co_return request; };
        ise::provide_dynamic(*this, contract_of(asked_), handler);
        co_return;
    }

    options asked_;
};

class dynamic_caller final : public ise::component {
public:
    dynamic_caller(options asked, ise::endpoint server, collector& into)
        : asked_(std::move(asked)), server_(std::move(server)), into_(into) {}

private:
    ise::task<> run() override {
        try {
            co_await measure();
        } catch (...) {
            into_.fail(std::current_exception());
        }
    }

    ise::task<> measure() {
        auto peer = at(server_);
        auto connected = co_await peer.connect(generous);
        connected.value();
        const auto service = contract_of(asked_);
        auto packet = packet_of(asked_);
        outcome out;
        const auto times = span::after_warm_up(asked_);
        for (auto before = now_ns(); before < times.end_ns;) {
            auto answered = co_await ise::call_dynamic(peer, service, std::move(packet), generous);
            packet = std::move(answered).value();
            const auto after = now_ns();
            if (before >= times.begin_ns) {
                out.latency.add(after - before);
                out.seconds += static_cast<double>(after - before) * 1e-9;
            }
            before = after;
        }
        out.count = out.latency.samples();
        into_.take(std::move(out));
    }

    options asked_;
    ise::endpoint server_;
    collector& into_;
};

} // namespace

std::unique_ptr<ise::component> make_dynamic_server(const options& asked) {
    return std::make_unique<dynamic_server>(asked);
}

void start_dynamic_caller(ise::node& node, const options& asked, const ise::endpoint& server, collector& into) {
    node.start<dynamic_caller>("bench/caller", beside_server(asked), asked, server, into);
}

} // namespace bench
