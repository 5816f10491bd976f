#include <ise/transport/security.hpp>

#include <ise/access/guard.hpp>
#include <ise/core/complain.hpp>
#include <ise/core/verified_peer.hpp>
#include <ise/transport/shared_key.hpp>
#include <ise/transport/tls/identity.hpp>

#include <fmt/format.h>

namespace ise {
namespace {

result<access::audit_log> audit_of(environment& env, const std::string& file) {
    if (file.empty() || env.is_virtual()) return access::audit_log();
    return access::audit_log::open(file, [](const std::string& why) { complain("ise", why); });
}

} // namespace

result<security> security::load(environment& env, security_options given) {
    auto unless_given = [&env](std::string& to, const char* variable) {
        auto outcome = env.variable(variable);
        if (to.empty() && outcome) to = std::move(*outcome);
    };
    unless_given(given.key_file, "ISE_KEY");
    unless_given(given.tls_folder, "ISE_TLS");
    unless_given(given.access_file, "ISE_ACCESS");
    unless_given(given.audit_file, "ISE_AUDIT");
    auto is_set = [&env](const char* variable) -> result<bool> {
        auto outcome = env.variable(variable).value_or("");
        if (!outcome.empty() && outcome != "0" && outcome != "1")
            return failure(errc::invalid_argument, fmt::format("{} is 0 or 1, not '{}'", variable, outcome));
        return outcome == "1";
    };
    auto demanded = is_set("ISE_DEMAND_CREDENTIALS");
    if (!demanded) return demanded.error();
    auto legacy = is_set("ISE_KEY_LEGACY");
    if (!legacy) return legacy.error();
    security made;
    made.demanded = given.demanded || *demanded;
    if (!given.key_file.empty()) {
        auto key = shared_key::load(env, given.key_file, *legacy);
        if (!key)
            return failure(key.error().code(),
                           fmt::format("no shared key (--key, ISE_KEY): {}", key.error().message()));
        made.key = std::move(*key);
    }
    if (!given.tls_folder.empty()) {
        auto tls = net::tls::identity::load(env, given.tls_folder);
        if (!tls) return failure(tls.error().code(), fmt::format("no TLS (--tls, ISE_TLS): {}", tls.error().message()));
        made.tls = std::move(*tls);
    }
    if (!given.access_file.empty()) {
        auto audit = audit_of(env, given.audit_file);
        if (!audit)
            return failure(audit.error().code(),
                           fmt::format("no audit log (--audit, ISE_AUDIT): {}", audit.error().message()));
        auto policy = access::guard::load(env, given.access_file, std::move(*audit));
        if (!policy)
            return failure(policy.error().code(),
                           fmt::format("no access policy (--access, ISE_ACCESS): {}", policy.error().message()));
        made.access = std::move(*policy);
    } else if (!given.audit_file.empty()) {
        return failure(errc::invalid_argument, "an audit log (--audit, ISE_AUDIT) needs an access policy (--access, "
                                               "ISE_ACCESS), whose decisions it holds");
    }
    // Of its own process only, so that this is no proof of anything.
    if (made.tls) made.own = made.tls->who();
    if (made.own.empty() && made.key) {
        verified_peer self;
        self.has_key = true;
        auto policy = made.access ? made.access->current() : nullptr;
        made.own = access::identity_of(self, {}, policy.get());
    }
    return made;
}

bool security::protects(const endpoint& at) const noexcept { return key || at.kind->encrypted; }

result<void> security::may_listen(const endpoint& at) const {
    if (!demanded || within_host(at) || protects(at)) return {};
    return failure(
        errc::unauthorized,
        fmt::format("nobody may listen on {} without credentials: every host that reaches it could use it. Give it a "
                    "shared key (--key FILE or ISE_KEY), or let it "
                    "listen on tls:// or udp+tls:// with certificates (--tls FOLDER or ISE_TLS), or on 127.0.0.1 or a "
                    "local socket",
                    at.text()));
}

} // namespace ise
