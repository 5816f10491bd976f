#pragma once
#include <ise/component/node.hpp>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace atirma {

/// One component that the command line asked for.
struct hosted {
    std::string path;
    std::vector<std::string> listen;    ///< endpoints; empty: ISE's default
    std::vector<std::string> advertise;
    std::function<std::unique_ptr<ise::component>()> make;
};

/// Adds the components of A-Tirma as subcommands of `run`, each with its options. After parsing, those that were named stand
/// in `into`, which outlives the parser. Lines such as "ready: http://…" go to `announce`, from any thread.
void add_components(CLI::App& run, std::vector<hosted>& into, std::function<void(const std::string&)> announce);

} // namespace atirma
