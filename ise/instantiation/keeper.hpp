#pragma once
#include <ise/instantiation/launch_order.hpp>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

namespace ise::instantiation {

/// A keeper is a small process between an instantiation server and a program that it started, and outlives the server.
/// It writes what the program prints to a bounded file, keeps all that the program starts below itself (a subreaper,
/// and a control group where there is one) within limits, ends what is left of it when the program ends, and records
/// how that ended (kept_status.hpp). It ends last. It is the instantiation server's own program, started with other
/// words.
inline constexpr const char* keeper_word = "keep-instance";

/// The words that make the instantiation server's program a keeper.
std::vector<std::string> keeper_words(const launch_order& what, const std::string& cgroup);

/// The line in which a keeper says what became of its start, read from its output; empty: it said nothing within
/// `limit`. Blocks.
std::string line_of_keeper(int from, std::chrono::milliseconds limit);

/// If a program was started with these words: its exit code when it has been a keeper to the end.
std::optional<int> keep_if_asked(int count, const char* const* words);

} // namespace ise::instantiation
