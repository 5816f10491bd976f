#pragma once
#include <string_view>

namespace ise {

/// One line on standard error, "PROGRAM: what"; what another process put into the text is escaped (`readable`). Whole
/// lines from any thread; an error of writing is ignored.
void complain(std::string_view program, std::string_view what);

} // namespace ise
