#include "waits.hpp"

#include "text.hpp"

#include <fmt/format.h>

namespace ise::cli {

std::string wait_line(const wait_text& of) {
    auto whom = of.service.empty() ? of.target : fmt::format("'{}' of {}", of.service, of.target);
    std::string what = fmt::format("it waits for {}", whom);
    if (of.stage == "unreached") what = fmt::format("its last call of {} reached no provider, and none has", whom);
    else if (!of.service.empty())
        what += of.stage == "provider" ? ", with which there is no session," : ", which is not found,";
    return fmt::format("{} since {} ({}){}{}", what, show_wall(of.since), show_duration(of.waited),
                       of.cause.empty() ? "" : ": ", of.cause);
}

} // namespace ise::cli
