#pragma once
#include <components/byte_stream/outgoing.hpp>
#include <components/gprs_link/carrier_air.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/log.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/task.hpp>
#include <ise/net/bounded_acceptor.hpp>

#include <array>
#include <deque>
#include <functional>
#include <list>
#include <memory>

namespace atirma {

/// Carries connections: each that the boat makes gets one to the proxy; what goes through is delayed, in order and
/// complete, for as long as nobody breaks it. Used on one loop; must outlive the coroutines that it spawns.
class stream_relay {
public:
    static constexpr std::size_t max_calls = 64;       ///< beyond, `ise::net::fair_places` decides
    static constexpr std::size_t max_held = 64 * 1024; ///< under way in one direction; then nothing more is read

    stream_relay(ise::loop& on, ise::logger log, carrier_air& air, ise::endpoint proxy,
                 std::function<void(std::string, ise::task<>)> spawn)
        : loop_(on), log_(std::move(log)), air_(air), proxy_(std::move(proxy)), spawn_(std::move(spawn)) {}

    ise::result<ise::endpoint> open(const ise::endpoint& at);
    /// The air has changed: what was held may go.
    void look_again();
    void drop_all();
    void freeze_all();

    std::size_t calls() const noexcept { return calls_.size(); }
    std::size_t frozen() const;
    std::size_t held() const;

private:
    struct piece {
        ise::time_point due;
        std::string bytes;
    };
    struct half { // one direction
        ise::stream* from = nullptr;
        ise::stream* to = nullptr;
        std::deque<piece> under_way;
        std::size_t held = 0;
        outgoing unwritten;
        bool ended = false; // nothing more comes
        bool shut = false;  // and that was passed on
    };
    struct call {
        explicit call(stream_relay& self) : due(self.loop_, [this, &self] { self.turn(*this); }) {}
        std::shared_ptr<ise::stream> boat, proxy;            // no proxy while it is dialled
        std::unique_ptr<ise::net::fair_places::place> place; // from its first moment on
        std::array<half, 2> halves;                          // up, down
        ise::timer due;
        bool frozen = false, over = false;
    };

    void take(ise::net::admitted who);
    ise::task<> carry(std::shared_ptr<call> of);
    ise::task<> pump(std::shared_ptr<call> of, std::size_t which);
    void turn(call& of);
    void write(call& of, half& way, bool upward);
    void end(call& of);

    ise::loop& loop_;
    ise::logger log_;
    carrier_air& air_;
    ise::endpoint proxy_;
    std::function<void(std::string, ise::task<>)> spawn_;
    ise::net::fair_places places_{max_calls}; // before the calls, which hold them
    std::list<std::shared_ptr<call>> calls_;  // as they came
};

} // namespace atirma
