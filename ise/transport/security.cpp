#include <ise/transport/security.hpp>

#include <ise/transport/shared_key.hpp>
#include <ise/transport/tls/identity.hpp>

#include <fmt/format.h>

namespace ise {

result<security> security::load(environment& env, security_options given) {
    auto unless_given = [&env](std::string& to, const char* variable) {
        auto told = env.variable(variable);
        if (to.empty() && told) to = std::move(*told);
    };
    unless_given(given.key_file, "ISE_KEY");
    unless_given(given.tls_folder, "ISE_TLS");
    auto is_set = [&env](const char* variable) -> result<bool> {
        auto told = env.variable(variable).value_or("");
        if (!told.empty() && told != "0" && told != "1")
            return failure(errc::invalid_argument, fmt::format("{} is 0 or 1, not '{}'", variable, told));
        return told == "1";
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
    return made;
}

bool security::protects(const endpoint& at) const noexcept { return key || at.kind->encrypted; }

result<void> security::may_listen(const endpoint& at) const {
    if (!demanded || within_host(at) || protects(at)) return {};
    return failure(
        errc::unauthorized,
        fmt::format("nobody may listen on {} without credentials: every host that reaches it could use it. Give it a "
                    "shared key (--key FILE or ISE_KEY), or let it "
                    "listen on tls:// with certificates (--tls FOLDER or ISE_TLS), or on 127.0.0.1 or a local socket",
                    at.text()));
}

} // namespace ise
