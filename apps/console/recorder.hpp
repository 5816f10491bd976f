#pragma once
#include <components/gui_client/view.hpp>

#include <QFile>
#include <QString>

#include <cstdint>

namespace atirma::console {

/// Writes every received packet to a CSV file: number, times, proxy, link, boot, sequence, history, kind, bytes in hex.
class recorder {
public:
    /// Returns why it cannot be written, or an empty string.
    QString start(const QString& path);
    void stop();
    bool running() const { return file_.isOpen(); }
    QString path() const { return file_.fileName(); }
    std::uint64_t written() const noexcept { return written_; }
    /// The number of packets that were dropped between two snapshots.
    std::uint64_t missed() const noexcept { return missed_; }
    /// Writes the new packets. Returns an error, after which it has stopped, or an empty string.
    QString take(const snapshot& seen);

private:
    QFile file_;
    std::uint64_t last_ = 0, written_ = 0, missed_ = 0;
};

/// Writes a whole file atomically, through a temporary one beside it. Returns an error, or an empty string.
QString write_file(const QString& path, const std::string& content);

} // namespace atirma::console
