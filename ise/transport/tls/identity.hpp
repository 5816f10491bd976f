#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/result.hpp>

#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

struct ssl_ctx_st; // of OpenSSL

namespace ise::net::tls {

/// Where they are, in PEM.
struct identity_files {
    std::string authorities; ///< and their revocation lists, of each or of none
    std::string certificate; ///< its own, with intermediate ones behind it; empty: none, for a client of other servers
    std::string key;         ///< of the certificate; readable by the owner only
};

/// The certificate of a node, its key, and the authorities that it believes. Thread-safe.
class identity {
public:
    /// Files that were changed count for sessions that are made this much later. Who looks for revoked peers does so
    /// every 5 s: together that is less than 10 s.
    static constexpr duration reread_after = std::chrono::seconds(4);

    /// Errors: errc::unauthorized (others can read the key), errc::io_failed, errc::invalid_argument, each with the
    /// file.
    static result<std::shared_ptr<identity>> load(environment& env, identity_files from);
    /// The same of ca.pem, certificate.pem and key.pem in a folder.
    static result<std::shared_ptr<identity>> load(environment& env, const std::string& folder);

    /// What a new session is made with. Where the files cannot be used any more (one is gone, or half written) that is
    /// the error: what was revoked meanwhile is not let in.
    result<std::shared_ptr<ssl_ctx_st>> context(environment& env);

    /// Whether a peer with these certificates (`verified_peer::chain`) was revoked, by the present lists. While the
    /// files cannot be used, by the last ones that could.
    bool revoked(environment& env, const std::vector<std::string>& chain);

    const identity_files& files() const noexcept { return files_; }

    /// The identity in its own certificate (`ise://SYSTEM/NAME`); empty: it has none.
    std::string who() const {
        std::lock_guard lock(mutex_);
        return who_;
    }

private:
    struct contents {
        std::string authorities, certificate, key;
        bool operator==(const contents&) const = default;
    };

    explicit identity(identity_files from) : files_(std::move(from)) {}
    void refresh(environment& env);
    result<void> reread(environment& env);
    result<contents> read(environment& env) const;
    result<std::string> show_own(ssl_ctx_st* to, const contents& from) const;
    result<std::shared_ptr<ssl_ctx_st>> build(const contents& from);

    const identity_files files_;
    mutable std::mutex mutex_;
    contents seen_;
    std::shared_ptr<ssl_ctx_st> made_;
    std::string who_;
    bool knows_revoked_ = false;
    std::set<std::string> revoked_; // as in `verified_peer::chain`
    time_point read_at_{};
    std::optional<failure> trouble_; // with the files, when they were read last
};

} // namespace ise::net::tls
