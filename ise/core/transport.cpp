#include <ise/core/transport.hpp>

#include <fmt/format.h>

#include <array>
#include <atomic>
#include <mutex>
#include <stdexcept>

namespace ise {
namespace {

// Rows are only added, so that whoever looks for one takes no lock.
struct added_transports {
    std::array<std::atomic<const transport*>, 16> rows{};
    std::atomic<std::size_t> count = 0;
};

constinit added_transports added;

std::mutex& adding() { // no constant on every system
    static std::mutex one;
    return one;
}

} // namespace

std::vector<protocol> all_transports() {
    std::vector<protocol> all;
    for (const auto* row : built_in_transports()) all.push_back(*row);
    const auto count = added.count.load(std::memory_order_acquire);
    for (std::size_t i = 0; i < count; ++i) all.push_back(*added.rows[i].load(std::memory_order_relaxed));
    return all;
}

const transport* find_transport(std::string_view scheme) noexcept {
    for (const auto* row : built_in_transports())
        if (row->scheme == scheme) return row;
    const auto count = added.count.load(std::memory_order_acquire);
    for (std::size_t i = 0; i < count; ++i)
        if (const auto* row = added.rows[i].load(std::memory_order_relaxed); row->scheme == scheme) return row;
    return nullptr;
}

const transport* transport_of(std::string_view text) noexcept {
    auto scheme_end = text.find("://");
    return scheme_end == text.npos ? nullptr : find_transport(text.substr(0, scheme_end));
}

std::vector<std::string> schemes_between_processes() {
    std::vector<std::string> made;
    for (auto one : all_transports())
        if (!one->same_process) made.emplace_back(one->scheme);
    return made;
}

void add_transport(const transport& row) {
    std::lock_guard held(adding());
    const auto count = added.count.load(std::memory_order_relaxed);
    if (find_transport(row.scheme))
        throw std::logic_error(fmt::format("there is a transport '{}' already", row.scheme));
    if (count == added.rows.size())
        throw std::logic_error(
            fmt::format("{} transports were added, which is the limit: '{}' is not", count, row.scheme));
    added.rows[count].store(&row, std::memory_order_relaxed);
    added.count.store(count + 1, std::memory_order_release);
}

} // namespace ise
