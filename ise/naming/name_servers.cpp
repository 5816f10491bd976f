#include <ise/naming/name_servers.hpp>

#include <ise/naming/services.hpp>

#include <fmt/format.h>

namespace ise {

result<std::vector<endpoint>> parse_name_servers(std::string_view text) {
    std::vector<endpoint> all;
    for (std::size_t begin = 0; begin <= text.size();) {
        auto end = std::min(text.find(',', begin), text.size());
        auto one = endpoint::parse(std::string(text.substr(begin, end - begin)));
        if (!one) return one.error();
        if (all.size() == max_name_servers)
            return failure(errc::invalid_argument,
                           fmt::format("more than {} name servers in one list (max_name_servers)", max_name_servers));
        all.push_back(std::move(*one));
        begin = end + 1;
    }
    return all;
}

result<std::vector<endpoint>> usual_name_servers(const environment& env) {
    auto outcome = env.variable("ISE_NAME_SERVER");
    if (!outcome || outcome->empty()) return std::vector<endpoint>{default_name_server()};
    auto all = parse_name_servers(*outcome);
    if (!all) return failure(all.error().code(), "ISE_NAME_SERVER: " + all.error().message());
    return all;
}

} // namespace ise
