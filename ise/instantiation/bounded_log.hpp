#pragma once
#include <ise/instantiation/kept_status.hpp>
#include <ise/instantiation/process_table.hpp>

#include <optional>
#include <string>
#include <string_view>

namespace ise::instantiation {

/// The output of a process: a file of at most so many bytes and an older one beside it, and the record of both
/// (kept_status.hpp). It never waits for room: what cannot be written is dropped, counted, and marked by a line once
/// there is room again.
class bounded_log {
public:
    bounded_log(std::string file, std::uint64_t max_bytes);

    /// Goes on behind what a process before has printed. The line that marks the new life; nothing for the first.
    std::optional<std::string> begin_life(const std::string& mark);
    void set_process(const process_stamp& who);
    void append(std::string_view text);
    /// "--- life 2: …", on a line of its own.
    void mark_line(const std::string& text);
    void end_life(const process_end& how, std::uint64_t at_ms);

private:
    bool open();
    void rotate();
    std::size_t write(std::string_view text);
    void record(bool moving = false);

    std::string file_;
    std::uint64_t max_bytes_;
    file_handle to_, status_file_;
    kept_status status_;
    std::uint64_t sequence_ = 0;
    std::uint64_t size_ = 0;     // of the file
    std::uint64_t unmarked_ = 0; // dropped since the last line that said so
    bool in_line_ = false;
};

} // namespace ise::instantiation
