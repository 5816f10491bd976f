#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

/// The word that a process leaves of its end where nobody is there to be told: who had started it has gone, and the system
/// tells an exit code to nobody else.
namespace ise::word_of_end {

/// The variable that asks for it: what `variable_for` made.
inline constexpr const char* variable = "ISE_WORD_OF_END";

/// Of a process that `starter` starts under a mark: where the word is to be left. No space is in the mark.
std::string variable_for(std::uint64_t starter, const std::string& mark, const std::string& file);

/// For the end of `main`: leaves the word if this process was asked for it, and its starter has gone. Gives the exit code back.
int leave(int exit_code) noexcept;

/// The exit code that the process of that number and mark has left in the file's text; nothing: it left none.
std::optional<int> read(std::string_view text, const std::string& mark, std::int32_t process_id);

} // namespace ise::word_of_end
