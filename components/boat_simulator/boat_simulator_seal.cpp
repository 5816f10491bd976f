// What the boat believes on its links, and how it seals what it sends.
#include <components/boat_simulator/boat_simulator.hpp>

#include <ise/service/service_host.hpp>

namespace atirma {
namespace {
using namespace std::chrono_literals;
// Anybody can repeat a packet of a key holder, and each notice takes airtime, or money.
constexpr ise::duration notice_period = 5s, satellite_notice_period = 10min;
} // namespace

/// A key that cannot be read is an error: without it the boat would obey everybody.
void boat_simulator::open_seal() {
    seal_.reset();
    if (options_.radio_key_file.empty()) {
        log().warning("the radio is not sealed: the boat obeys whoever can send to it (set radio-key)", {});
        ise::caution open;
        open.message = "telecommands to it are not sealed: anybody with a radio can command the boat";
        open.advice = seal::make_a_key;
        services().warn_of(std::move(open));
        return;
    }
    ise::when_damaged how(log(), [this] { return std::chrono::floor<std::chrono::system_clock::duration>(wall()); });
    seal_ = std::move(seal::boat_links::open(env(), options_.radio_key_file, std::move(how)).value());
    log().info("the radio is sealed",
               {{"boat", seal_->keys().now.boat}, {"key", seal::fingerprint(seal_->keys().now)}});
}

ise::bytes boat_simulator::sealed(link_id link, ise::bytes raw) const {
    return seal_ ? seal_->seal(link, raw) : std::move(raw);
}

/// Nothing: refused, or about the seal only.
std::optional<ise::bytes> boat_simulator::opened(link_id link, ise::bytes_view raw) {
    if (!seal_) return ise::bytes(raw.begin(), raw.end());
    auto before = seal_->keys();
    auto plain = seal_->open(link, raw);
    tell_keys(before);
    if (plain) {
        if (!plain->empty()) return std::move(*plain);
        log().info("the shore has sent a packet about the seal", {{"link", std::string(name_of(link))}});
        return std::nullopt;
    }
    if (auto left_out = quiet_.admit(now()))
        log().warning("a packet was refused", {{"cause", plain.error().message()},
                                               {"link", std::string(name_of(link))},
                                               {"left_out", std::to_string(*left_out)}});
    return std::nullopt;
}

void boat_simulator::tell_keys(const seal::boat_keys& before) {
    const auto& now = seal_->keys();
    if (now.next && (!before.next || before.next->secret != now.next->secret))
        log().info("the shore has sent the next key of the radio",
                   {{"key", seal::fingerprint(*now.next)},
                    {"epoch", std::to_string(now.next->epoch)},
                    {"by", now.next_by_recovery ? "the recovery key" : "the key in use"}});
    if (before.now.secret != now.now.secret)
        log().info("the key of the radio has changed",
                   {{"key", seal::fingerprint(now.now)}, {"epoch", std::to_string(now.now.epoch)}});
}

void boat_simulator::send_notices() {
    if (!seal_) return;
    if (port_ && radio_on_ && port_->modem_ready()) {
        auto raw = seal_->take_notice(link_id::xbee, now(), notice_period);
        if (!raw.empty() && !port_->send(options_.shore_address, std::move(raw), notice_period)) ++failed_;
    }
    if (uplink_) {
        auto raw = seal_->take_notice(link_id::gprs, now(), notice_period);
        if (!raw.empty()) uplink_->put_sealed(std::move(raw));
    }
    if (iridium_) {
        auto raw = seal_->take_notice(link_id::iridium, now(), satellite_notice_period);
        if (!raw.empty()) iridium_->put_sealed(std::move(raw));
    }
}

} // namespace atirma
