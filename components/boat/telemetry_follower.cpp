#include <components/boat/telemetry_follower.hpp>

#include <ise/asio.hpp>
#include <ise/component/discover.hpp>

namespace atirma {
namespace {

using namespace std::chrono_literals;

constexpr ise::duration look_period = 1s; // whether another node has taken over
constexpr std::size_t max_stores = 4;     // those of two nodes, and of the disks that they had before

} // namespace

telemetry_follower::telemetry_follower(ise::component& self, ise::remote provider, teller tell)
    : self_(self), provider_(std::move(provider)), tell_(std::move(tell)), due_(self.on(), [this] { look(); }) {}

telemetry_follower::~telemetry_follower() = default; // `alive_` goes: an answer that is under way finds nobody

ise::task<> telemetry_follower::run() {
    auto packets = co_await provider_.subscribe(services::telemetry, ise::subscribe_options::keep_last(1024));
    struct following {
        telemetry_follower& of;
        ~following() {
            of.stream_ = nullptr;
            of.due_.disarm();
        }
    } guard{*this};
    stream_ = &packets;
    std::string track(services::track.name());
    auto keeps = co_await ise::provides(provider_, track);
    plain_ = keeps && !*keeps; // a proxy: it keeps nothing
    missing_ = !plain_;
    look();
    for (;;) {
        auto packet = co_await packets.next();
        if (!packet) break;
        if (plain_) lost_ += packet.lost_before().value_or(0);
        on_packet(*packet);
    }
}

void telemetry_follower::begin_anew() {
    seen.clear();
    told_ = duplicate_filter();
    alive_ = std::make_shared<bool>(true); // an answer that is under way follows what was known
    asking_ = false;
    missing_ = !plain_;
    if (stream_) look();
}

bool telemetry_follower::knows(const telemetry_packet& packet) const {
    auto up_to = [this](std::uint64_t store) {
        auto found = seen.find(store);
        return store == 0 || found == seen.end() ? std::uint64_t{0} : found->second;
    };
    return up_to(packet.store) >= packet.position ||
           (packet.peer_store != 0 && up_to(packet.peer_store) >= packet.peer_position);
}

void telemetry_follower::on_packet(const telemetry_packet& packet) {
    if (packet.store == 0) {
        tell_(packet);
        return;
    }
    auto known = seen.find(packet.store);
    bool next = known != seen.end() && packet.position == known->second + 1;
    if (next) {
        bool fresh = !knows(packet);
        known->second = packet.position;
        if (fresh) tell(packet);
    } else if (!knows(packet)) {
        missing_ = true; // and this one comes with what is missing before it
        look();
    }
}

void telemetry_follower::tell(const telemetry_packet& packet) {
    if (told_.first_time(packet.boot, packet.sequence, packet.raw)) tell_(packet);
}

/// Asks for the next page of what is missing, and comes again.
void telemetry_follower::look() {
    due_.arm(ise::saturating_add(self_.now(), look_period));
    if (plain_ || asking_) return;
    auto holder = provider_.holder();
    if (!holder.empty() && holder != holder_) missing_ = true;
    holder_ = holder;
    if (!missing_) return;
    asking_ = true;
    missing_ = false;
    track_request request;
    request.seen = seen;
    request.from = from;
    provider_.try_call(services::track, request, 10s,
                       [this, alive = std::weak_ptr<bool>(alive_)](ise::result<track_page> page) {
                           if (!alive.expired()) on_page(page);
                       });
}

void telemetry_follower::on_page(const ise::result<track_page>& page) {
    asking_ = false;
    if (!page) {
        plain_ = page.error().code() == ise::errc::no_such_service; // a proxy: it keeps nothing
        missing_ = !plain_;
        return; // `due_` tries again
    }
    for (const auto& packet : page->packets)
        if (!knows(packet)) tell(packet);
    // Packets received live meanwhile are known as well. A number that the page does not name any more is that of an
    // earlier life of a store, whose present number stands for it.
    auto before = std::exchange(seen, page->seen);
    for (auto& [store, position] : seen)
        if (auto known = before.find(store); known != before.end()) position = std::max(position, known->second);
    while (seen.size() > max_stores) {
        auto oldest = std::ranges::find_if(
            seen, [&](const auto& one) { return page->packets.empty() || one.first != page->packets.back().store; });
        seen.erase(oldest);
    }
    if (page->more) missing_ = true;
    if (missing_) look();
}

} // namespace atirma
