// In the place of pki.cpp, where ISE is built without OpenSSL (ISE_WITH_OPENSSL).
#include "pki.hpp"

#include "exit_code.hpp"

namespace ise::cli::pki {
namespace {

[[noreturn]] void not_built() {
    throw problem(exit_code::failed, "not_built", "ise keys cannot be used: this ISE was built without OpenSSL",
                  "build it with -DISE_WITH_OPENSSL=ON");
}

} // namespace

std::string system_of(const std::string&) { not_built(); }
key_and_request make_request(const subject&) { not_built(); }
authority authority::make(const std::string&, moment, days) { not_built(); }
std::string authority::sign(const std::string&, moment, days) const { not_built(); }
std::string authority::sign_again(const std::string&, moment) const { not_built(); }
void authority::revoke(const std::vector<std::string>&, moment, days) { not_built(); }
void authority::list_again(moment) { not_built(); }
bool same_key(const std::string&, const std::string&) { not_built(); }
std::vector<description> describe(const std::string&, const std::string&) { not_built(); }

} // namespace ise::cli::pki
