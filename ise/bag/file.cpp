// environment-boundary: recordings are read and written in pieces, off the loop; the environment has small files only
#include <ise/bag/file.hpp>

#include <ise/core/error.hpp>
#include <ise/core/real/own_file.hpp>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

namespace ise::bag {
namespace {

failure bag_file_failure(const char* what, const std::string& name) {
    return io_failure(fmt::format("cannot {} {}", what, name), std::error_code(errno, std::generic_category()));
}

class descriptor {
public:
    explicit descriptor(int number) noexcept : number_(number) {}
    ~descriptor() {
        if (number_ >= 0) ::close(number_);
    }
    descriptor(const descriptor&) = delete;
    descriptor& operator=(const descriptor&) = delete;
    int number() const noexcept { return number_; }

private:
    int number_;
};

class file_source final : public source {
public:
    file_source(int opened, std::string name) : file_(opened), name_(std::move(name)) {}
    const std::string& name() const noexcept override { return name_; }
    result<std::uint64_t> size() override {
        struct stat about {};
        if (::fstat(file_.number(), &about) != 0) return bag_file_failure("read", name_);
        return static_cast<std::uint64_t>(about.st_size);
    }
    result<std::size_t> read(std::uint64_t offset, std::span<std::byte> into) override {
        std::size_t done = 0;
        while (done < into.size()) {
            auto got =
                ::pread(file_.number(), into.data() + done, into.size() - done, static_cast<off_t>(offset + done));
            if (got < 0 && errno == EINTR) continue;
            if (got < 0) return bag_file_failure("read", name_);
            if (got == 0) break;
            done += static_cast<std::size_t>(got);
        }
        return done;
    }

private:
    descriptor file_;
    std::string name_;
};

class file_sink final : public sink {
public:
    file_sink(int opened, std::string name) : file_(opened), name_(std::move(name)) {}
    // An empty file, as on a disk that was full already, would only be in the way of the next attempt.
    ~file_sink() override {
        if (empty_) ::unlink(name_.c_str());
    }
    const std::string& name() const noexcept override { return name_; }
    result<void> write(bytes_view data) override {
        while (!data.empty()) {
            auto moved = ::write(file_.number(), data.data(), data.size());
            if (moved < 0 && errno == EINTR) continue;
            if (moved < 0) return bag_file_failure("write", name_);
            empty_ = false;
            data = data.subspan(static_cast<std::size_t>(moved));
        }
        return {};
    }
    result<void> sync() override {
        if (::fdatasync(file_.number()) != 0 && errno != EINVAL && errno != EROFS)
            return bag_file_failure("write", name_);
        return {};
    }

private:
    descriptor file_;
    std::string name_;
    bool empty_ = true;
};

class bytes_source final : public source {
public:
    bytes_source(bytes_view data, std::string name) : data_(data), name_(std::move(name)) {}
    const std::string& name() const noexcept override { return name_; }
    result<std::uint64_t> size() override { return data_.size(); }
    result<std::size_t> read(std::uint64_t offset, std::span<std::byte> into) override {
        if (offset >= data_.size()) return std::size_t{0};
        auto from = data_.subspan(static_cast<std::size_t>(offset));
        from = from.first(std::min(from.size(), into.size()));
        std::copy(from.begin(), from.end(), into.begin());
        return from.size();
    }

private:
    bytes_view data_;
    std::string name_;
};

class bytes_sink final : public sink {
public:
    bytes_sink(bytes& to, std::string name) : to_(to), name_(std::move(name)) {}
    const std::string& name() const noexcept override { return name_; }
    result<void> write(bytes_view data) override {
        to_.insert(to_.end(), data.begin(), data.end());
        return {};
    }

private:
    bytes& to_;
    std::string name_;
};

} // namespace

result<std::unique_ptr<source>> open_file(const std::string& path) {
    int opened = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOCTTY);
    if (opened < 0) return bag_file_failure("open", path);
    auto made = std::make_unique<file_source>(opened, path);
    struct stat about {};
    if (::fstat(opened, &about) != 0) return bag_file_failure("read", path);
    if (!S_ISREG(about.st_mode))
        return failure(errc::io_failed, fmt::format("{} is no regular file: a recording is read at any place", path));
    return std::unique_ptr<source>(std::move(made));
}

result<std::unique_ptr<sink>> create_file(const std::string& path) {
    int opened = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    if (opened < 0 && errno == EEXIST)
        return failure(errc::name_taken,
                       fmt::format("{} exists already, and is not overwritten: remove it, or choose another", path));
    if (opened < 0) return bag_file_failure("create", path);
    auto made = std::make_unique<file_sink>(opened, path);
    // Its name, too, is to be there after a loss of power. Not every file system can promise that.
    [[maybe_unused]] auto unsynced = sync_folder_of(path);
    return std::unique_ptr<sink>(std::move(made));
}

std::unique_ptr<source> memory_source(bytes_view data, std::string name) {
    return std::make_unique<bytes_source>(data, std::move(name));
}

std::unique_ptr<sink> memory_sink(bytes& to, std::string name) {
    return std::make_unique<bytes_sink>(to, std::move(name));
}

} // namespace ise::bag
