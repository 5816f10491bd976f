// ise version
#include "options.hpp"

namespace ise::cli {
namespace {

void declare_version(command_line::app& app, parsed_command& made) {
    app.callback([&made] { made.text = "ise " ISE_VERSION "\n"; });
}

} // namespace

extern const command version_command{"version", shell_group, "prints the version", "  ise version\n", declare_version};

} // namespace ise::cli
