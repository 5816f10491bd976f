#pragma once
#include <ise/instantiation/machine.hpp>
#include <ise/instantiation/services.hpp>

#include <string>

namespace ise::instantiation {

/// What an instance has printed: a file that it appends to, and an older one, both bounded. They outlive everybody.
class output_file {
public:
    output_file(machine& host, std::string file, std::uint64_t max_bytes);

    const std::string& file() const noexcept { return file_; }
    /// Beside it: where who prints there leaves word of its end (ise/component/word_of_end.hpp).
    std::string end_file() const { return file_ + ".end"; }
    /// Looks at it, now and then: keeps it within its bounds, and gives what has come since the last time (as much as is
    /// given at once) if somebody wants it. `offset` jumps over what could not be kept.
    output_piece look(bool wanted);
    /// The end of it, from the start of a line on, at most so many bytes.
    output_piece last(std::size_t max_bytes) const;
    /// Its last lines, for a message.
    std::string last_lines(std::size_t lines) const;
    void remove();

private:
    std::string older() const { return file_ + ".1"; }

    machine& host_;
    std::string file_;
    std::uint64_t max_bytes_;
    std::uint64_t base_ = 0; // bytes that were moved away before those in the file
    std::uint64_t seen_ = 0; // of those in the file
};

} // namespace ise::instantiation
