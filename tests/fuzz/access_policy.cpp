// Any text is an access policy, or has something wrong with it; what it is decides any question.
#include <ise/access/policy.hpp>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::string text(reinterpret_cast<const char*>(data), size);
    std::vector<ise::access::remark> problems;
    auto made = ise::access::policy::parse(text, "access.toml", problems);
    if ((made == nullptr) == problems.empty()) std::abort();
    if (!made) return 0;
    const std::string titles[] = {text.substr(0, 40), "atirma/boat"};
    for (const char* service : {"telecommand", "ise.change_parameters", "ise.host.start", "ise.names.list"})
        for (bool subscription : {false, true}) {
            auto said = made->decide("ise://atirma/web", ise::access::request_for(subscription, titles, service));
            if (said.allowed && said.denied) std::abort();
        }
    return 0;
}
