// environment-boundary: what an instantiation server does to its host is done here
#include <ise/instantiation/bounded_log.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace ise::instantiation {
namespace {

constexpr int own_log_file = O_CREAT | O_CLOEXEC | O_NOFOLLOW;

} // namespace

bounded_log::bounded_log(std::string file, std::uint64_t max_bytes)
    : file_(std::move(file)), max_bytes_(std::max<std::uint64_t>(max_bytes, 4096)) {}

std::optional<std::string> bounded_log::begin_life(const std::string& mark) {
    auto before = read_kept_status(content_of_file(status_file_of(file_), kept_status_bytes));
    if (before) status_ = std::move(*before);
    std::optional<std::string> again;
    if (status_.life > 0) {
        timespec now{};
        ::clock_gettime(CLOCK_BOOTTIME, &now);
        auto now_ms =
            static_cast<std::uint64_t>(now.tv_sec) * 1000 + static_cast<std::uint64_t>(now.tv_nsec) / 1'000'000;
        bool known = status_.ended && status_.ended_at_ms <= now_ms;
        again = known ? fmt::format("started again after {:.1f} s",
                                    static_cast<double>(now_ms - status_.ended_at_ms) / 1000)
                      : std::string("started again");
    }
    ++status_.life;
    status_.mark = mark;
    status_.process = {};
    status_.ended = false;
    status_.how = {};
    open();
    record();
    return again;
}

void bounded_log::set_process(const process_stamp& who) {
    status_.process = who;
    record();
}

void bounded_log::end_life(const process_end& how, std::uint64_t at_ms) {
    status_.ended = true;
    status_.how = how;
    status_.ended_at_ms = at_ms;
    record();
}

void bounded_log::mark_line(const std::string& text) {
    append(fmt::format("{}--- life {}: {}\n", in_line_ ? "\n" : "", status_.life, text));
}

void bounded_log::append(std::string_view text) {
    if (text.empty()) return;
    if (unmarked_ > 0) {
        auto notice = fmt::format("{}--- {} bytes of output were dropped: {}\n", in_line_ ? "\n" : "", unmarked_,
                                  status_.trouble);
        if (write(notice) == notice.size()) {
            unmarked_ = 0;
            status_.trouble.clear();
            record();
        }
    }
    auto written = unmarked_ > 0 ? 0 : write(text);
    if (written > 0) in_line_ = text[written - 1] != '\n';
    if (written == text.size()) return;
    unmarked_ += text.size() - written;
    status_.dropped += text.size() - written;
    record();
}

std::size_t bounded_log::write(std::string_view text) {
    std::size_t done = 0;
    while (done < text.size()) {
        if (!open()) break;
        if (size_ >= max_bytes_) {
            rotate();
            continue;
        }
        auto most = static_cast<std::size_t>(std::min<std::uint64_t>(text.size() - done, max_bytes_ - size_));
        auto moved = ::write(to_.get(), text.data() + done, most);
        if (moved < 0 && errno == EINTR) continue;
        if (moved > 0) {
            done += static_cast<std::size_t>(moved);
            size_ += static_cast<std::uint64_t>(moved);
            continue;
        }
        status_.trouble = std::strerror(errno);
        // The newest is worth more than the oldest.
        bool full = errno == ENOSPC || errno == EDQUOT;
        if (!full || ::unlink(older_output_of(file_).c_str()) != 0) break;
    }
    return done;
}

bool bounded_log::open() {
    if (to_) return true;
    to_ = file_handle(::open(file_.c_str(), O_WRONLY | O_APPEND | own_log_file, 0600));
    if (!to_) {
        status_.trouble = std::strerror(errno);
        return false;
    }
    struct stat about {};
    size_ = ::fstat(to_.get(), &about) == 0 ? static_cast<std::uint64_t>(about.st_size) : 0;
    char last = '\n';
    file_handle reading(::open(file_.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
    if (size_ > 0 && reading) [[maybe_unused]]
        auto got = ::pread(reading.get(), &last, 1, static_cast<off_t>(size_ - 1));
    in_line_ = last != '\n';
    return true;
}

void bounded_log::rotate() {
    record(true);
    // Nothing is copied: that would take room, and time in which more is printed.
    if (::rename(file_.c_str(), older_output_of(file_).c_str()) == 0) to_ = file_handle();
    else [[maybe_unused]] auto cut = ::ftruncate(to_.get(), 0);
    status_.base += size_;
    size_ = 0;
    open();
    record();
}

void bounded_log::record(bool moving) {
    if (!status_file_) status_file_ = file_handle(::open(status_file_of(file_).c_str(), O_WRONLY | own_log_file, 0600));
    if (!status_file_) return; // tried again the next time
    auto text = kept_status_text(status_, ++sequence_, moving);
    [[maybe_unused]] auto written = ::pwrite(status_file_.get(), text.data(), text.size(), 0);
}

} // namespace ise::instantiation
