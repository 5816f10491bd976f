#pragma once
#include <support/relay.hpp>

namespace ise_test {

/// With at most `piece` bytes of each direction in its own hand.
std::unique_ptr<relay> make_byte_relay(ise::environment& env, std::unique_ptr<ise::loop_host> host,
                                       const ise::endpoint& at, const ise::endpoint& to, std::size_t piece = 16 * 1024);
std::unique_ptr<relay> make_datagram_relay(ise::environment& env, std::unique_ptr<ise::loop_host> host,
                                           const ise::endpoint& at, const ise::endpoint& to);

} // namespace ise_test
