"""Controllers that follow targets of any rate, and the smooth motion behind them."""
