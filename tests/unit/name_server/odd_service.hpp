// A component of a stranger, whose service is described in a way that no C++ type is.
#pragma once
#include <unit/name_server/system.hpp>

#include <ise/component/provide_dynamic.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/service/dynamic.hpp>

#include <string>
#include <utility>

namespace names_test {

/// Provides the subscription "odd" with these types, and publishes a packet without bytes ten times a second.
inline void start_odd_service(system& in, const std::string& host, const std::string& path,
                              const std::string& subscribe_request, const std::string& published) {
    auto parse = [&] {
        const std::string nothing = "struct e{}";
        return ise::dynamic_contract::parse("odd", ise::service_kind::subscription,
                                            {subscribe_request, nothing, published, nothing, nothing});
    };
    auto run = [contract = parse().value()](ise::component& self) -> ise::task<> {
        auto out = ise::publish_dynamic(self, contract);
        ise::dynamic_packet packet(contract.packet(ise::role::published), ise::bytes());
        for (;;) {
            co_await self.sleep(100ms);
            out(packet);
        }
    };
    in.start(host, "odd", [path, run](ise::node& node) { node.start(path, run, everywhere()); });
}

/// Subscribe packets that have no defaults: no struct, or more than 256 MiB of them.
inline const char* const without_defaults[] = {"u8", "vector<u8>",
                                               "struct p{a:array<struct q{v:vector<u8>=04000000aabbccdd},40000000>}"};

} // namespace names_test
