#include <ise/naming/name_resolver.hpp>

#include <support/catch.hpp>

namespace resolver_test {

namespace {

ise::naming::resolve_response component() {
    ise::naming::resolve_response made;
    made.host_key = "boat.1";
    made.process_key = "77.abc";
    made.endpoints = {"tcp://10.0.0.2:4000", "tcp://127.0.0.1:4001", "udp://10.0.0.2:4002", "nonsense",
                      "inproc://x",          "tcp://[::1]:4003",     "local://@x"};
    return made;
}

std::vector<std::string> reached_from(std::string host_key, std::string process_key) {
    ise::process_identity here;
    here.host_key = std::move(host_key);
    here.process_key = std::move(process_key);
    std::vector<std::string> texts;
    for (const auto& at : ise::reachable_endpoints(component(), here)) texts.push_back(at.text());
    return texts;
}

using list = std::vector<std::string>;

} // namespace

TEST_CASE("naming: within a process the in-process name is the nearest") {
    CHECK(reached_from("boat.1", "77.abc") == list{"inproc://x", "local://@x", "tcp://127.0.0.1:4001",
                                                   "tcp://[::1]:4003", "tcp://10.0.0.2:4000", "udp://10.0.0.2:4002"});
}

TEST_CASE("naming: within a host the local socket is the nearest") {
    CHECK(reached_from("boat.1", "78.abc") ==
          list{"local://@x", "tcp://127.0.0.1:4001", "tcp://[::1]:4003", "tcp://10.0.0.2:4000", "udp://10.0.0.2:4002"});
}

TEST_CASE("naming: another host is not sent to its own loopback addresses") {
    CHECK(reached_from("shore.1", "77.xyz") == list{"tcp://10.0.0.2:4000", "udp://10.0.0.2:4002"});
}

TEST_CASE("naming: a prefix ends where a name of the path ends") {
    using ise::naming::lies_below;
    CHECK(lies_below("atirma/boat", ""));
    CHECK(lies_below("atirma/boat", "atirma"));
    CHECK(lies_below("atirma/boat", "atirma/"));
    CHECK(lies_below("atirma", "atirma"));
    CHECK_FALSE(lies_below("atirma2", "atirma"));
    CHECK_FALSE(lies_below("atirma", "atirma/boat"));
}

} // namespace resolver_test
