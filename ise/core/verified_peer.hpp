#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace ise {

/// Who the other side of a session is, as far as this side has verified it; nothing of it is the peer's own word.
struct verified_peer {
    /// The identity that the rest comes to: "ise://atirma/web", "unix:1001"; empty: nobody that is known.
    std::string who;
    std::string serial;      ///< of its certificate, hexadecimal; empty: it showed none
    std::string from;        ///< its address, for people
    std::string certificate; ///< the URI in its certificate; empty: none
    /// Issuer and serial of each certificate from its own to the authority, as revocation lists name them.
    std::vector<std::string> chain;
    std::optional<std::uint32_t> user; ///< its user on this host, over a local socket
    bool has_key = false;              ///< it proved the shared key
    bool same_process = false;         ///< nothing lies between the two
};

/// A stream whose transport knows something of the peer (certificate, user).
class verified_stream {
public:
    /// Adds what is known, once the first byte of the peer was read.
    virtual void add_verified(verified_peer& to) const = 0;

protected:
    ~verified_stream() = default;
};

} // namespace ise
