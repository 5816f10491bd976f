#pragma once
#include <ise/core/buffer.hpp>
#include <ise/transport/shared_key.hpp>
#include <ise/wire/frame.hpp>
#include <ise/wire/messages.hpp>

#include <optional>

namespace ise::net {

/// One side's part in proving that both know the shared key (FORMAT.md, section 5). Pure: the handshake carries what it
/// says, and tells it every frame of the handshake, in the order of the conversation.
class authentication {
public:
    static constexpr std::string_view scheme = "hmac-sha256";
    static constexpr std::size_t nonce_bytes = 32;

    /// `key` may be null: nothing is proved then, and nothing demanded. It outlives this.
    authentication(const shared_key* key, environment& env) : key_(key), env_(env) {}

    bool demanded() const noexcept { return key_ != nullptr; }
    /// A frame that was sent or has come.
    void note(const wire::frame_header& header, bytes_view body);

    /// Of the initiator, in its hello; and of the responder as its challenge.
    wire::credentials offer();
    /// Of the responder: what is wrong with the offer in a hello.
    std::optional<failure> objection(const wire::credentials& offered) const;
    /// Of the initiator: what is wrong with a challenge.
    std::optional<failure> strange_challenge(const wire::credentials& came) const;

    /// What proves, after all that was noted so far, that a side knows the key.
    wire::credentials proof(bool of_initiator) const;
    /// Compares in constant time.
    static bool same(const wire::credentials& wanted, const wire::credentials& given) noexcept;

private:
    const shared_key* key_;
    environment& env_;
    buffer transcript_;
};

} // namespace ise::net
