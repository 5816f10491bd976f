#include "journal.hpp"

#include <cstdio>
#include <cstring>

namespace seeds {

void journal::add(std::string text) {
    auto line = fmt::format("{}.{:06} {}", world_.elapsed() / std::chrono::seconds(1),
                            world_.elapsed() % std::chrono::seconds(1) / std::chrono::microseconds(1), text);
    std::size_t at = 0;
    for (; at + 8 <= line.size(); at += 8) {
        std::uint64_t word = 0;
        std::memcpy(&word, line.data() + at, 8);
        hash_ = (hash_ ^ word) * 0x100000001B3u;
    }
    for (; at < line.size(); ++at) hash_ = (hash_ ^ static_cast<unsigned char>(line[at])) * 0x100000001B3u;
    ++count_;
    if (verbose_) std::printf("%s\n", line.c_str());
    if (newest_.size() == kept) newest_.pop_front();
    newest_.push_back(std::move(line));
}

void journal::fail(std::string text) {
    add("VIOLATION " + text);
    if (!violation_) violation_ = std::move(text);
}

std::string journal::newest() const {
    std::string lines;
    for (const auto& line : newest_) lines += "  " + line + "\n";
    return lines;
}

} // namespace seeds
