// ise_foxglove_gateway: the component type `foxglove-gateway`, for viewers such as Foxglove and Lichtblick.
#include <components/foxglove_gateway/foxglove_gateway.hpp>

#include <cstdio>
#include <string>
#include <vector>

int main(int count, char** arguments) {
    auto announce = [](const std::string& line) {
        std::fputs((line + "\n").c_str(), stdout);
        std::fflush(stdout);
    };
    std::vector<ise::component_type> types;
    types.push_back(
        ise::foxglove::gateway_type("foxglove-gateway", "ise/foxglove", ise::foxglove::gateway_options(), announce));
    return ise::main(count, arguments, std::move(types), ISE_VERSION);
}
