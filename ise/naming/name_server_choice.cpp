#include <ise/naming/name_server_choice.hpp>

#include <ise/naming/services.hpp>

namespace ise {

result<endpoint> name_server_for(const environment& env, const std::optional<endpoint>& given) {
    if (given) return *given;
    auto told = env.variable("ISE_NAME_SERVER");
    if (!told || told->empty()) return default_name_server();
    auto at = endpoint::parse(*told);
    if (!at) return failure(at.error().code(), "ISE_NAME_SERVER: " + at.error().message());
    return at;
}

} // namespace ise
