#pragma once
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// Certificates as `ise keys` makes and reads them: texts in PEM, without files. Every function throws `problem`
/// (exit_code.hpp) that says what is wrong with which of the texts. Without OpenSSL each of them throws so.
namespace ise::cli::pki {

using moment = std::chrono::sys_seconds;
using days = std::chrono::days;

/// To whom a certificate belongs, and where peers may reach it.
struct subject {
    std::string identity;           ///< "ise://SYSTEM/NAME"
    std::vector<std::string> hosts; ///< names and addresses that peers dial
};

/// The system of "ise://SYSTEM/NAME"; problem(usage) unless it is one: lower-case segments as in a path, the name of at
/// most 64 bytes.
std::string system_of(const std::string& identity);

/// A private key, and what it signed. The key never leaves the host that made it.
struct key_and_request {
    std::string key, request;
};
key_and_request make_request(const subject& whose);

/// Signs for one system. Holds the private key of the authority; short-lived.
struct authority {
    std::string certificate, key; ///< PEM
    std::string list;             ///< revoked certificates; empty: there was never one

    /// A new one, valid from an hour before `now`.
    static authority make(const std::string& system, moment now, days valid);

    /// The certificate of a request. Only its identity, its hosts and its public key are taken over.
    std::string sign(const std::string& request, moment now, days valid) const;
    /// The same certificate, for another time of the same length. Of this authority, and not revoked.
    std::string sign_again(const std::string& former, moment now) const;
    /// Makes a list with those that were in it and `more`.
    void revoke(const std::vector<std::string>& more, moment now, days valid);
    /// Signs the list again, for another time of the same length.
    void list_again(moment now);
    /// What hosts trust: the certificate, and the list behind it.
    std::string trusted() const { return certificate + list; }
};

/// Whether two certificates are for one key.
bool same_key(const std::string& one, const std::string& other);

/// What a file in PEM is.
struct description {
    std::string kind;                 ///< "certificate", "authority", "request", "revocation list", "private key"
    std::string identity;             ///< of a certificate or a request
    std::vector<std::string> hosts;   ///< of them
    std::string subject, issuer;      ///< for people
    std::string serial;               ///< hexadecimal
    std::string fingerprint;          ///< SHA-256 of the certificate, hexadecimal
    std::string public_key;           ///< "EC P-256"
    std::optional<moment> from;       ///< valid from
    std::optional<moment> until;      ///< valid until; of a list: the next one is due
    std::vector<std::string> revoked; ///< serials
    std::string trouble;              ///< why it cannot be used here; empty: nothing is known against it

    /// Two thirds of the time have passed.
    std::optional<moment> renew_at() const {
        if (!from || !until) return std::nullopt;
        return *from + (*until - *from) * 2 / 3;
    }
};
/// All blocks of a text, in order. problem where there is none, or one cannot be read; `from` names the text.
std::vector<description> describe(const std::string& text, const std::string& from);

} // namespace ise::cli::pki
