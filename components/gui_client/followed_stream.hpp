#pragma once
#include <components/gui_client/client_context.hpp>

#include <algorithm>
#include <functional>
#include <string>

namespace atirma::console {

/// Exponential back-off between two attempts: 0.5 s to 5 s.
class back_off {
public:
    explicit back_off(ise::component& self) : self_(self) {}
    void reset() noexcept { pause_ = first; }
    /// Cancellation: terminal.
    ise::task<> wait() { return self_.sleep(std::exchange(pause_, std::min<ise::duration>(2 * pause_, longest))); }

private:
    static constexpr ise::duration first = std::chrono::milliseconds(500), longest = std::chrono::seconds(5);
    ise::component& self_;
    ise::duration pause_ = first;
};

/// Whether a provider is reached, and why not.
class stream_health {
public:
    explicit stream_health(std::string at_first = std::string()) : trouble_(std::move(at_first)) {}
    stream_health(const stream_health&) = delete;
    stream_health& operator=(const stream_health&) = delete;

    bool reached() const { return connected_ && connected_(); }
    /// Empty where it is reached.
    std::string trouble() const {
        if (reached()) return std::string();
        return connected_ && trouble_.empty() ? std::string("it is not reached") : trouble_;
    }
    void set_trouble(std::string why) { trouble_ = std::move(why); }

    /// For the lifetime of a stream, which reconnects by itself: only it knows whether it is connected. `of` may be
    /// null.
    class watch {
    public:
        watch(stream_health* of, std::function<bool()> connected) : of_(of) {
            if (!of_) return;
            of_->connected_ = std::move(connected);
            of_->trouble_.clear();
        }
        watch(const watch&) = delete;
        watch& operator=(const watch&) = delete;
        ~watch() {
            if (of_) of_->connected_ = nullptr;
        }

    private:
        stream_health* of_;
    };

private:
    std::function<bool()> connected_;
    std::string trouble_;
};

/// A subscription service, and how it is followed.
template <class Contract>
struct stream_use {
    explicit stream_use(const Contract& of) : service(of) {}

    Contract service;
    typename Contract::subscribe_request request{};
    ise::subscribe_options options = ise::subscribe_options::keep_latest();
    /// The response to each subscription. May be empty.
    std::function<void(const typename Contract::subscribe_response&)> on_response;
    /// Each packet. False: subscribe again.
    std::function<bool(const ise::received<typename Contract::packet_type>&)> on_packet;
    stream_health* health = nullptr; ///< where it is shown whether the provider is reached
    bool optional = false;           ///< ends where the provider has no such service
};

/// Subscribes, and again with exponential back-off whenever that ends or fails. Cancellation: terminal.
template <class Contract>
ise::task<> follow_stream(client_context& context, ise::remote provider, stream_use<Contract> use) {
    back_off pause(context.self);
    for (;;) {
        std::string trouble;
        bool has_none = false;
        try {
            auto stream = co_await provider.subscribe(use.service, use.request, use.options);
            pause.reset();
            stream_health::watch shown(use.health, [&stream] { return stream.connected(); });
            if (use.on_response) use.on_response(stream.response());
            for (;;) {
                auto packet = co_await stream.next();
                if (!packet || !use.on_packet(packet)) break;
                context.news();
            }
            if (stream.ended()) trouble = stream.cause().message();
        } catch (const ise::error& problem) {
            if (problem.code() == ise::errc::cancelled) throw;
            trouble = problem.what();
            has_none = use.optional && problem.code() == ise::errc::no_such_service;
        }
        if (has_none) co_return;
        if (use.health) use.health->set_trouble(std::move(trouble));
        co_await pause.wait();
    }
}

} // namespace atirma::console
