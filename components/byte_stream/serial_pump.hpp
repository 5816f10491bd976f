#pragma once
#include <components/byte_stream/outgoing.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/log.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/task.hpp>

#include <array>
#include <memory>
#include <string>

namespace atirma {

/// What speaks over a serial port, without I/O.
class serial_driver {
public:
    virtual void on_open(ise::time_point now) = 0;
    virtual void on_bytes(ise::time_point now, ise::bytes_view bytes) = 0;
    virtual void on_time(ise::time_point now) = 0;
    virtual void on_closed(ise::time_point now, const std::string& reason) = 0;
    /// Deals with the next event, which may make more output and events; false where there is none.
    virtual bool handle_event() = 0;
    virtual ise::bytes take_output() = 0;
    /// When `on_time` wants to be called; time_point::max() if nothing is due.
    virtual ise::time_point next_event() const = 0;

protected:
    ~serial_driver() = default;
};

/// A serial port for a driver: opened through the environment, and opened again after it vanished. Used on one loop;
/// must outlive `run()`, and its driver outlives it.
class serial_pump {
public:
    struct options {
        ise::serial_options port;
        ise::duration min_retry{}; ///< between attempts to open it; doubles
        ise::duration max_retry{};
    };
    serial_pump(ise::loop& on, ise::logger log, serial_driver& driver, options chosen);

    /// Opens the port and serves it until it is cancelled. Never fails: what is wrong is logged and shown by
    /// `trouble()`.
    ise::task<> run();
    /// To be called after every request to the driver: handles its events and writes its output.
    void service();

    bool is_open() const noexcept { return stream_ != nullptr; }
    /// Times that the port was opened.
    std::uint64_t openings() const noexcept { return openings_; }
    /// Why nothing can be sent now; empty where it can.
    const std::string& trouble() const noexcept { return trouble_; }
    /// The modem at the port answers, or does not any more: then it is logged why.
    void on_answer() { trouble_.clear(); }
    void on_silence(const std::string& reason);

private:
    ise::task<std::string> serve();

    ise::loop& loop_;
    ise::logger log_;
    serial_driver& driver_;
    options options_;
    std::unique_ptr<ise::stream> stream_;
    ise::timer wake_;
    outgoing unwritten_;
    std::array<std::byte, 1024> buffer_{};
    std::string trouble_ = "the port was not opened yet";
    std::uint64_t openings_ = 0;
    bool servicing_ = false;
};

} // namespace atirma
