#pragma once
#include "fleet.hpp"

#include <support/raw_datagrams.hpp>

namespace hostile_test {

using ise::wire::chunk_type;

constexpr std::uint32_t part = 1024; // of a message

/// A boat with a subscriber in good order over udp, which must miss nothing, and a peer whose datagrams are made by
/// hand.
struct strait : fleet {
    explicit strait(ise::service_options options = {}) : fleet("udp", options) {
        all.run_until([&] { return fixes.subscribers() == 1; });
        peer.greet();
        if (!of_raw()) throw std::logic_error("no session");
    }
    void go_on(ise::duration time = 20ms) {
        publish(1);
        ++published;
        all.world.run_for(time);
    }
    void alive() { peer.put(chunk_type::probe, {}); }
    /// The others missed nothing, and the peer's session is there or is not.
    void nobody_noticed(bool session) {
        all.world.run_for(100ms);
        CHECK(counting.seen.size() == published);
        CHECK(boat.services->counts().sessions_accepted == 2);
        CHECK((of_raw() != nullptr) == session);
        others_do_not_notice();
    }
    /// A message whose end shows whether its beginning was kept: it is no packet, which ends the session.
    void begin_telltale(std::uint64_t number) { telltale(number, 0); }
    bool telltale_is_kept(std::uint64_t number) {
        telltale(number, 1);
        go_on();
        return warned("a message came beside the stream that is not a packet");
    }

    listener counting{*this, ise::subscribe_options::keep_last(64)};
    std::size_t published = 0;
    raw_channel peer{all, sea, channel};

private:
    void telltale(std::uint64_t number, std::uint32_t index) {
        ise::buffer whole;
        ise::wire::put_frame(whole, frame_type::request, 0, 0,
                             [](ise::buffer& to) { to.append(ise::bytes_view(ise::bytes(part))); });
        peer.fragment(number, static_cast<std::uint32_t>(whole.size()), index,
                      whole.view().subspan(index * part, index == 0 ? part : whole.size() - part));
    }
};

} // namespace hostile_test
