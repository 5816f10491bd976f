#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/result.hpp>

#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

struct ssl_ctx_st; // of OpenSSL

namespace ise::net::tls {

/// The certificate of a node, its key, and the authorities that it believes, in one folder of PEM files:
/// ca.pem (authorities; and their revocation lists, of each or of none), certificate.pem (its own, with intermediate
/// ones behind it), key.pem (readable by the owner only). Thread-safe.
class identity {
public:
    /// Files that were changed count for sessions that are made this much later. Who looks for revoked peers does so
    /// every 5 s: together that is less than 10 s.
    static constexpr duration reread_after = std::chrono::seconds(4);

    /// Errors: errc::unauthorized (others can read key.pem), errc::io_failed, errc::invalid_argument, each with the
    /// file.
    static result<std::shared_ptr<identity>> load(environment& env, const std::string& folder);

    /// What a new session is made with. Where the files cannot be used any more (one is gone, or half written) that is
    /// the error: what was revoked meanwhile is not let in.
    result<std::shared_ptr<ssl_ctx_st>> context(environment& env);

    /// Whether a peer with these certificates (`verified_peer::chain`) was revoked, by the present lists. While the
    /// files cannot be used, by the last ones that could.
    bool revoked(environment& env, const std::vector<std::string>& chain);

    /// The identity in its own certificate (`ise://SYSTEM/NAME`); empty: it has none.
    std::string who() const {
        std::lock_guard lock(mutex_);
        return who_;
    }

private:
    struct files {
        std::string authorities, certificate, key;
        bool operator==(const files&) const = default;
    };

    explicit identity(std::string folder) : folder_(std::move(folder)) {}
    result<void> refresh(environment& env);
    result<files> read(environment& env) const;
    result<std::shared_ptr<ssl_ctx_st>> build(const files& from);

    const std::string folder_;
    mutable std::mutex mutex_;
    files seen_;
    std::shared_ptr<ssl_ctx_st> made_;
    std::string who_;
    bool knows_revoked_ = false;
    std::set<std::string> revoked_; // as in `verified_peer::chain`
    time_point read_at_{};
};

} // namespace ise::net::tls
