#pragma once
#include <components/iridium/rockblock.hpp>

#include <chrono>
#include <memory>
#include <string>
#include <string_view>

namespace atirma::iridium {

/// Checks the JSON web tokens (RS256) that a gateway signs its posts with, by its public key.
class jwt_key {
public:
    /// Of a PEM text, a public key or a certificate. Error: invalid_argument.
    static ise::result<jwt_key> parse(std::string_view pem);

    jwt_key(jwt_key&&) noexcept;
    jwt_key& operator=(jwt_key&&) noexcept;
    ~jwt_key();

    /// The claims of a token, as JSON. Errors: unauthorized, with what is wrong: no token, another algorithm than
    /// RS256, a signature of somebody else.
    ise::result<std::string> verify(std::string_view token) const;
    /// Whether the token of a delivery is good, and signs this very message: its claims have imei, momsn, transmit_time
    /// and data, the position if the delivery has one, and each is that of the delivery; so are serial and device_type
    /// where the token signs them. `exp` and `nbf`, where they are, hold at `now` to five minutes. Errors:
    /// unauthorized.
    ise::result<void> verify(const mo_delivery& delivery, std::chrono::sys_seconds now) const;

private:
    struct key;
    explicit jwt_key(std::unique_ptr<key> made);
    std::unique_ptr<key> key_;
};

/// A token with these claims (JSON), signed by a private key in PEM: for emulated gateways. Error: invalid_argument.
ise::result<std::string> sign_jwt(std::string_view private_pem, std::string_view claims);

} // namespace atirma::iridium
