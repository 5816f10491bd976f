// In the place of what OpenSSL does, where ISE is built without it (ISE_WITH_OPENSSL): credentials are refused, never
// ignored.
#include <ise/transport/shared_key.hpp>
#include <ise/transport/tls/stream.hpp>
#include <ise/transport/udp/seal.hpp>

#include <fmt/format.h>

#include <stdexcept>

namespace ise {
namespace {

failure not_built(std::string_view what) {
    return {errc::invalid_argument,
            fmt::format("{} cannot be used: this ISE was built without OpenSSL (ISE_WITH_OPENSSL)", what)};
}

} // namespace

result<std::shared_ptr<const shared_key>> shared_key::load(environment&, const std::string& file, bool) {
    return not_built(file);
}
result<std::shared_ptr<const shared_key>> shared_key::make(std::string_view, std::string_view from, bool) {
    return not_built(from);
}
shared_key::~shared_key() = default;
shared_key::digest shared_key::prove(std::string_view, bytes_view) const { throw std::logic_error("there is no key"); }
bool shared_key::equal(std::span<const std::uint8_t>, std::span<const std::uint8_t>) noexcept { return false; }

namespace net::tls {

result<std::shared_ptr<identity>> identity::load(environment&, identity_files from) {
    return not_built(from.authorities);
}
result<std::shared_ptr<identity>> identity::load(environment&, const std::string& folder) { return not_built(folder); }
result<std::shared_ptr<ssl_ctx_st>> identity::context(environment&) { return not_built("TLS"); }
bool identity::revoked(environment&, const std::vector<std::string>&) { return false; }
std::unique_ptr<stream> answer(loop&, std::unique_ptr<stream>, std::shared_ptr<identity>) {
    throw std::logic_error("there is no identity");
}
task<result<std::unique_ptr<stream>>> greet(loop&, std::unique_ptr<stream>, std::shared_ptr<identity>, endpoint) {
    co_return not_built("TLS");
}
std::unique_ptr<stream> answer(loop&, std::unique_ptr<stream>, std::shared_ptr<const shared_key>) {
    throw std::logic_error("there is no key");
}
task<result<std::unique_ptr<stream>>> greet(loop&, std::unique_ptr<stream>, std::shared_ptr<const shared_key>,
                                            endpoint) {
    co_return not_built("a shared key");
}

} // namespace net::tls

std::unique_ptr<net::udp::seal> net::udp::seal::make(std::shared_ptr<const shared_key>, bool, key_life) {
    throw std::logic_error("there is no key");
}
std::unique_ptr<net::udp::seal> net::udp::seal::make(std::shared_ptr<tls::identity>, environment&, std::string,
                                                     key_life) {
    throw std::logic_error("there is no identity");
}

} // namespace ise
