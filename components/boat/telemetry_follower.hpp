#pragma once
#include <components/boat/communication.hpp>
#include <components/boat/duplicate_filter.hpp>

#include <ise/component/component.hpp>

#include <functional>
#include <memory>

namespace atirma {

/// All telemetry of a provider: live, and what was missed while it was out of reach, each packet once. Of the role of
/// the communication nodes it goes on with the other node when one dies, and knows by the packets' positions what that
/// one has that was not told yet; what was missed comes late, in between. Of a proxy it tells what the proxy publishes.
/// Used on the component's loop; outlived by the component, and by `tell`.
class telemetry_follower {
public:
    using teller = std::function<void(const telemetry_packet&)>;
    telemetry_follower(ise::component& self, ise::remote provider, teller tell);
    ~telemetry_follower();

    /// The packets told so far; keep it to go on after a restart. Packets of a node that returned with a
    /// backup of its disk meanwhile may be told again then: keep a `duplicate_filter` with it.
    track_cursor seen;
    std::optional<utc_time> from; ///< nothing that was measured before is asked for

    /// Follows until the provider ends the subscription. Throws as `subscribe` does. May be called again: nothing is
    /// told twice. Cancellation: terminal.
    ise::task<> run();
    /// Asks for everything once more, from the beginning: each packet is told again.
    void begin_anew();
    /// Whether packets can come now.
    bool connected() const noexcept { return stream_ && stream_->connected(); }
    /// Whether all that the provider had when it was asked last has been told.
    bool caught_up() const noexcept { return !missing_ && !asking_; }
    /// Published by a provider without positions, and lost on the way here.
    std::uint64_t lost() const noexcept { return lost_; }

private:
    void on_packet(const telemetry_packet& packet);
    void tell(const telemetry_packet& packet);
    bool knows(const telemetry_packet& packet) const;
    void look();
    void on_page(const ise::result<track_page>& page);

    ise::component& self_;
    ise::remote provider_;
    teller tell_;
    ise::timer due_;
    std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
    const ise::subscriber<ise::subscription<telemetry_packet>>* stream_ = nullptr;
    duplicate_filter told_; // where nodes that did not see each other could not say what the other one has told
    std::string holder_;
    std::uint64_t lost_ = 0;
    bool missing_ = true, asking_ = false, plain_ = false;
};

} // namespace atirma
