#include <ise/transport/udp/cookie.hpp>

#include <bit>
#include <cstring>

namespace ise::net::udp {
namespace {

// A key is used for this long; the one before it is still known then.
constexpr duration secret_life = std::chrono::minutes(2);
static_assert(secret_life > cookie_jar::lifetime);

struct sip_state {
    std::uint64_t v0, v1, v2, v3;
    void round() noexcept {
        v0 += v1;
        v1 = std::rotl(v1, 13) ^ v0;
        v0 = std::rotl(v0, 32);
        v2 += v3;
        v3 = std::rotl(v3, 16) ^ v2;
        v0 += v3;
        v3 = std::rotl(v3, 21) ^ v0;
        v2 += v1;
        v1 = std::rotl(v1, 17) ^ v2;
        v2 = std::rotl(v2, 32);
    }
    void take(std::uint64_t word) noexcept {
        v3 ^= word;
        round();
        round();
        v0 ^= word;
    }
};

secret draw(environment& env) {
    secret drawn;
    for (auto& half : drawn) half = env.random();
    return drawn;
}

} // namespace

std::uint64_t keyed_hash(const secret& key, bytes_view text) noexcept {
    sip_state state{key[0] ^ 0x736f6d6570736575u, key[1] ^ 0x646f72616e646f6du, key[0] ^ 0x6c7967656e657261u,
                    key[1] ^ 0x7465646279746573u};
    std::size_t whole = text.size() / 8 * 8;
    for (std::size_t at = 0; at < whole; at += 8) state.take(detail::load_little<std::uint64_t>(text.data() + at));
    std::uint64_t rest = static_cast<std::uint64_t>(text.size()) << 56;
    for (std::size_t at = whole; at < text.size(); ++at)
        rest |= static_cast<std::uint64_t>(text[at]) << (8 * (at - whole));
    state.take(rest);
    state.v2 ^= 0xff;
    for (int i = 0; i < 4; ++i) state.round();
    return state.v0 ^ state.v1 ^ state.v2 ^ state.v3;
}

cookie_jar::cookie_jar(environment& env) : env_(env), key_(draw(env)), former_(draw(env)) {}

void cookie_jar::turn(time_point now) {
    if (drawn_ == time_point{}) drawn_ = now;
    if (now - drawn_ < secret_life) return;
    former_ = key_;
    key_ = draw(env_);
    drawn_ = now;
}

std::uint64_t cookie_jar::seal(const secret& key, const endpoint& stranger, std::uint64_t id,
                               std::uint64_t stamp) const {
    buffer text(64);
    text.append(stamp);
    text.append(id);
    text.append(stranger.port);
    text.append(as_bytes(stranger.host));
    return keyed_hash(key, text.view());
}

wire::cookie cookie_jar::bake(const endpoint& stranger, std::uint64_t id, time_point now) {
    turn(now);
    auto stamp = static_cast<std::uint64_t>(now.time_since_epoch().count());
    wire::cookie made;
    auto* raw = reinterpret_cast<std::byte*>(made.data());
    detail::store_little(raw, stamp);
    detail::store_little(raw + 8, seal(key_, stranger, id, stamp));
    return made;
}

bool cookie_jar::accepts(const wire::cookie& shown, const endpoint& stranger, std::uint64_t id, time_point now) {
    turn(now);
    auto* raw = reinterpret_cast<const std::byte*>(shown.data());
    auto stamp = detail::load_little<std::uint64_t>(raw);
    auto sealed = detail::load_little<std::uint64_t>(raw + 8);
    // A stamp that only a forger writes may lie anywhere: compared without arithmetic that overflows.
    auto present = static_cast<std::uint64_t>(now.time_since_epoch().count());
    if (stamp > present || present - stamp > static_cast<std::uint64_t>(lifetime.count())) return false;
    return sealed == seal(key_, stranger, id, stamp) || sealed == seal(former_, stranger, id, stamp);
}

} // namespace ise::net::udp
